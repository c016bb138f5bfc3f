"""Many rigs from one template: the table, a pipeline for each row, results as a dataset, trends, and a page for all."""
