"""The verbs of the `pcrdiff` command."""
