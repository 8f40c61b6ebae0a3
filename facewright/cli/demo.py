"""The main job on the embedded sample: a head that the project made itself, with the faults of a real scan.

  facewright demo            # writes into demo/
"""

from facewright.cli.progress import ProgressLine
from facewright.cli.rig import add_job_arguments, summarise

HELP = "the main job on the embedded sample"


def add_arguments(parser):
    """Arguments of `facewright demo`."""
    parser.add_argument("--out", default="demo", metavar="FOLDER", help="folder that receives the rig (default: demo)")
    add_job_arguments(parser)


def run(options):
    """Run the job on the sample."""
    from facewright.pipeline import JobOptions, rig_job
    from facewright.sample import sample_path

    fields = {name: getattr(options, name) for name in JobOptions.__dataclass_fields__ if hasattr(options, name)}
    progress = ProgressLine(options.quiet)
    report = rig_job(sample_path(), options.out, JobOptions(**fields), progress)
    progress.finish()
    summarise(report, options.out)
