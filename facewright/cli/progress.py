"""The progress line on standard error."""

import sys
import time


class ProgressLine:
    """Callable for pipeline.rig_job: one line a stage, with its time and what is left."""

    def __init__(self, quiet=False):
        self.quiet = quiet
        self.stage, self.started = None, time.perf_counter()

    def __call__(self, stage, number, count, seconds_left, message):
        if self.quiet or stage == self.stage:
            return
        self._close()
        self.stage, self.started = stage, time.perf_counter()
        left = f", about {seconds_left:.0f} s left" if seconds_left is not None else ""
        name = stage.split("-", 1)[1]
        sys.stderr.write(f"[{number}/{count}] {name:<10}{left} ...")
        sys.stderr.flush()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.finish()

    def _close(self):
        if self.stage is not None:
            sys.stderr.write(f" {time.perf_counter() - self.started:.1f} s\n")

    def finish(self):
        """End the last line."""
        if not self.quiet:
            self._close()
            self.stage = None
