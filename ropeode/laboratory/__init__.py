"""The lab: motion and true error side by side, in a browser, a notebook or a single file.

Python computes every number; the page draws. The page asks, and each answer depends on its question
alone, so answers can be kept, shipped in a file and asked for again.
"""

from pathlib import Path

# The page's own files.
PAGE = Path(__file__).parent / "page"
