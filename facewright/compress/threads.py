"""Work in a few threads: NumPy and Pillow let go of the interpreter while they compute."""

from concurrent.futures import ThreadPoolExecutor
from itertools import count

THREADS = 2
_POOL = ThreadPoolExecutor(THREADS, thread_name_prefix="facezip")


def in_threads(function, items):
    """[function(item) for item in items], in order; function must not call in_threads itself."""
    items = list(items)
    if len(items) == 1:
        return [function(items[0])]
    results, numbers = [None] * len(items), count()

    def work():
        # One task a thread and a shared counter: thousands of small items would spend their time in the pool.
        while (i := next(numbers)) < len(items):
            results[i] = function(items[i])

    for future in [_POOL.submit(work) for _ in range(THREADS)]:
        future.result()
    return results
