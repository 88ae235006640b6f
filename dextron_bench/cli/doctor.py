"""`dextron-bench doctor`: what this machine has of what the benchmark needs."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from dextron_bench.cli.output import print_json, print_table


@dataclass(frozen=True)
class Doctor:
    """Show versions, renderers, devices and data; exit code 1 where something needed is missing.

    Example: dextron-bench doctor
    """

    json: bool = False
    """Print JSON, one object for each finding."""

    def __call__(self) -> int:
        from dextron_bench.cli.examination import examine

        findings = list(examine())
        if self.json:
            print_json([asdict(finding) for finding in findings])
        else:
            signs = {(True, True): "yes", (True, False): "yes", (False, True): "MISSING", (False, False): "no"}
            rows = [(f.what, signs[f.found, f.needed], f.detail) for f in findings]
            print_table("dextron-bench on this machine", ["what", "there", "detail"], rows)
        return 0 if all(finding.found for finding in findings if finding.needed) else 1
