"""Web pages and their parts: text, tables, plots; every page is one file that needs no network."""
