"""Reference trajectories in files: written whole, sealed, and checked before they are believed."""
