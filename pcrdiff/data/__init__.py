"""Raw data sets, and how pairs are made from them."""
