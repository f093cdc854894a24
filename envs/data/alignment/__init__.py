"""Several devices on one body: clocks, and the axes of sensors against those of the segments that carry them."""
