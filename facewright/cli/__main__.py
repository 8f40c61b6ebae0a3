"""The command line: `facewright COMMAND`. Bad input ends in one sentence and exit code 2, never in a traceback."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
import warnings
from contextlib import contextmanager

from facewright import __version__
from facewright.errors import InputError, StageError

DESCRIPTION = """Facewright turns one neutral 3D scan of a head into a face rig with the 52 ARKit shapes.

  facewright rig head.obj --albedo head.png --out result/
  facewright demo"""


class Parser(argparse.ArgumentParser):
    """Says what is wrong with a command in one line, as everything else does."""

    def error(self, message):
        self.exit(2, f"facewright: {message}; '{self.prog} --help' shows how\n")


def build_parser():
    """The parser of all commands; a command's module is imported only for its own arguments and run."""
    from facewright.cli import compress, decompress, demo, evaluate, landmarks, rig, template

    parser = Parser(prog="facewright", description=DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--version", action="version", version=f"facewright {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    modules = {"rig": rig, "demo": demo, "landmarks": landmarks, "template": template, "evaluate": evaluate}
    modules |= {"compress": compress, "decompress": decompress}
    for name, module in modules.items():
        command = commands.add_parser(
            name,
            help=module.HELP,
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(command)
        command.set_defaults(run=module.run)
    return parser


@contextmanager
def _interrupted_when_ended():
    """A request to end (SIGTERM, SIGHUP of a closed terminal) is like Ctrl-C: what was begun is tidied up."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    kinds = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    # A signal that is ignored stays so: nohup.
    kinds = [kind for kind in kinds if signal.getsignal(kind) != signal.SIG_IGN]
    before = {kind: signal.signal(kind, signal.default_int_handler) for kind in kinds}
    try:
        yield
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)


def main(arguments=None):
    """Run a command; returns the exit code."""
    options = build_parser().parse_args(arguments)
    try:
        with _interrupted_when_ended(), warnings.catch_warnings():
            # Broken input overflows on its way to the sentence that says so; the rest is in the report.
            warnings.simplefilter("ignore", RuntimeWarning)
            code = options.run(options) or 0
            sys.stdout.flush()
            return code
    except InputError as error:
        print(f"facewright: {error}", file=sys.stderr)
        return 2
    except StageError as error:
        print(f"facewright: {error} (outcome: {error.outcome})", file=sys.stderr)
        return 1
    except OSError as error:
        if sys.stdout is sys.__stdout__:  # a reader that is gone, a full disk: nothing more can be said there
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):  # `| head` has seen enough
            return 0
        where = f"{error.filename}: " if error.filename else ""
        print(f"facewright: {where}cannot be read or written ({error.strerror or error})", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        again = options.command in ("rig", "demo")
        more = "; the same command goes on from the last finished stage" if again else ""
        print(f"facewright: stopped{more}", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
