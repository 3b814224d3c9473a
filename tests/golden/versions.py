"""The formats of which golden files are kept."""

from pathlib import Path

VERSIONS = sorted(path for path in Path(__file__).parent.glob("v*") if path.is_dir())
