"""Work in a few threads: NumPy lets go of the interpreter while it computes."""

from concurrent.futures import ThreadPoolExecutor

THREADS = 2
_POOL = ThreadPoolExecutor(THREADS, thread_name_prefix="facezip")


def in_threads(function, items):
    """[function(item) for item in items], in order."""
    items = list(items)
    return [function(items[0])] if len(items) == 1 else list(_POOL.map(function, items))
