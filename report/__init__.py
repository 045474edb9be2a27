"""The report: figures of one run of the loop and the self-contained HTML page that holds them."""
