"""The site: pages, notebooks, docstrings and a gallery of what the scenarios made."""
