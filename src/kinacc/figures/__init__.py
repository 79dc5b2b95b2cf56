"""One function per figure: tables of columns in, a matplotlib Figure out, no file access."""
