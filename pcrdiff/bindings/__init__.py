"""Libraries with native code, so called that what they print, crash on or give up is one sentence."""
