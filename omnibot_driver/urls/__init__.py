# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""URL schemes of our own, one module each, named as pyserial looks for them."""
