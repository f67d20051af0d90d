"""Made-up data sets in the official layouts."""
