"""URL schemes of our own, one module each, named as pyserial looks for them."""
