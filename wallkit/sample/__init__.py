"""Package data: a small log with its map and truth, made by `python -m wallkit.pipelines.sample`."""
