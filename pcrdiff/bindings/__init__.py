"""Libraries with native code, called so that whatever they print or crash on ends in one sentence."""
