"""Results as text and as pictures. Reads results; computes and stores nothing."""
