"""The main job on the embedded sample: a head that the project made itself, with the faults of a real scan.

  facewright demo
  facewright demo --texture-size 512 --out small/

Without --out the result goes to demo/; run it again and only what changed is worked out.
"""

from facewright.cli.rig import add_job_arguments, run_job

HELP = "the main job on the embedded sample"


def add_arguments(parser):
    """Arguments of `facewright demo`."""
    parser.add_argument("--out", default="demo", metavar="FOLDER", help="folder that receives the rig (default: demo)")
    add_job_arguments(parser)


def run(options):
    """Run the job on the sample."""
    from facewright.sample import sample_path

    run_job(sample_path(), options)
