"""Make one HTML page, its tables as Parquet, a Markdown summary and JUnit XML from the stages' answers and tables."""
