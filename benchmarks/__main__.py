"""`python -m benchmarks`: one thread first, then everything else is loaded."""

import sys

from benchmarks.threads import hold_to_one

if __name__ == "__main__":
    hold_to_one(sys.argv[1:])

    from benchmarks.running import main

    main()
