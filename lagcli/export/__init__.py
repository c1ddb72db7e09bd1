"""Files that leave the program: tables (CSV, JSON, NPZ, Parquet) and figures."""
