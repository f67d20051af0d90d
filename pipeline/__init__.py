"""Glue between the library and files: params, artifacts, tracking, tables, the command line."""
