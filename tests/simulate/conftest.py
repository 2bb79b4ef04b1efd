"""What pictures need, or the reason why their tests are skipped."""

from __future__ import annotations

import os

import pytest

from wallkit.simulate.gl import APT_LINE, probe


@pytest.fixture(scope="session")
def gl() -> str:
    """The OpenGL that works here."""
    reasons = probe()
    works = [name for name, reason in reasons.items() if not reason]
    if works:
        return works[0]
    said = "; ".join(f"{name}: {reason}" for name, reason in reasons.items())
    if os.environ.get("WALLKIT_REQUIRE_GL") == "1":
        pytest.fail(f"no OpenGL works: {said}")
    pytest.skip(f"no OpenGL works ({said}); {APT_LINE}")
