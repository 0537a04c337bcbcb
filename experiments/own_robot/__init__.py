"""A robot of the reader: from its log to a bank and a page."""
