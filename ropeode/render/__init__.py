"""Results as text. Reads results; computes and stores nothing."""
