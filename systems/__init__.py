"""What decides: one Drake LeafSystem a block, grouped by the task it serves."""

import os

# Before numba is imported: the third level of its optimization gave no speed that could
# be measured for the time it takes to compile; nor do colours of messages nobody reads.
os.environ.setdefault("NUMBA_OPT", "2")
os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")
