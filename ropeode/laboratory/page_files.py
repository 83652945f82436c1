"""Where the page's own files are."""

from pathlib import Path

PAGE = Path(__file__).parent / "page"
