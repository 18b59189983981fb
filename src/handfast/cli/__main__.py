"""`python -m handfast.cli`."""

import sys

from handfast.cli import main

sys.exit(main())
