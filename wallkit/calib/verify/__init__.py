"""A calibration and what a recording shows -> PASS, FAIL or CANNOT TELL, with reasons; start at `verify`."""
