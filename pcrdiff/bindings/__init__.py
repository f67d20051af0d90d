"""Libraries with native code; what they print, crash on or give up ends in one sentence."""
