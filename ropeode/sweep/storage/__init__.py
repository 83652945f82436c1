"""What a sweep leaves on disk: rows in Parquet files, an index and a lock."""
