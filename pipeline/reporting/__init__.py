"""Results to tables, figures and the page: everything under ``reports/``."""
