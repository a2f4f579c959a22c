"""What `hevopt compare` is told, the files it leaves behind, and what it prints."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hevopt.commands.reporting import command_line
from hevopt.commands.terminal import Progress, show, show_notes, text_of, width, write
from hevopt.errors import DataError, HevoptError

if TYPE_CHECKING:
    from hevopt.driving.cycle import Cycle
    from hevopt.pages.comparison.collect import Collector
    from hevopt.problem.problem import Plan, Trajectory
    from hevopt.strategies import Strategy
    from hevopt.studies.by_car import Observe
    from hevopt.studies.cars import Cars
    from hevopt.studies.case import Case
    from hevopt.studies.cold_start import ColdStarts
    from hevopt.studies.comparison import Comparison
    from hevopt.studies.rows import Row
    from hevopt.studies.settings import Settings

# Settings that results name beside what was changed in the cars.
_NAMED = ("nox_weight", "allow_shortfall", "free_gear", "refine", "horizon_s")


def cold_starts(degc: float | None) -> "ColdStarts | None":
    """Who takes what rows burn from a start at a temperature, degrees Celsius; None where none is asked for."""
    if degc is None:
        return None
    from hevopt.studies.cold_start import ColdStarts

    return ColdStarts(degc)


@dataclass(frozen=True)
class ComparisonJob:
    """Cars on a cycle, the settings that they are solved with, the study file, if they come from one, and the
    strategies that were brought, by name; cold: takes what rows burn from a cold start, where that is asked for
    is_study: whether published figures may stand beside the results, see `reading.Read`
    """

    cars: "Cars"
    trace: "Cycle"
    settings: "Settings"
    file: Path | None = None
    brought: "Mapping[str, Strategy]" = field(default_factory=dict)
    cold: "ColdStarts | None" = None
    is_study: bool = False

    @cached_property
    def inputs(self) -> dict[str, str]:
        """File as it was read -> its digest."""
        from hevopt.studies.provenance import files_digests

        return dict(files_digests(self.cars.cars, [self.trace], self.others))

    @property
    def others(self) -> list[Path]:
        """Files read beside those of cars and cycle."""
        places = [other.place for other in self.brought.values()]
        files = [place.file for place in places if place is not None and place.file.is_file()]
        return ([] if self.file is None else [self.file]) + files

    @cached_property
    def about(self) -> dict[str, Any]:
        """What a result comes from: digests of the files read, versions, and the settings made; and what the rows
        solved so far burn from a cold start, where that is asked for."""
        from hevopt.studies.provenance import changes_shown, digests_shown, versions

        return {
            "inputs": digests_shown(self.inputs),
            "versions": versions(),
            "settings": {
                **{name: getattr(self.settings, name) for name in _NAMED},
                "changes": changes_shown(self.cars.changes),
                "left_out": self.cars.left_out,
            },
            **self._cold_contents(),
        }

    def _cold_contents(self) -> dict[str, Any]:
        if self.cold is None:
            return {}
        from hevopt.output.cold_tables import cold_contents

        return {"cold_start": cold_contents(self.cold)}


@dataclass
class Files:
    """Where results go, None for nowhere, and what of the solved cases they need.

    out: rows; steps: every step of every row; page, save: the report and what it is made from, with fronts and
    effects (sensitivities) of every car where asked for; proofs: the folder that every row's bound goes to
    nox_limit: what the page draws a line at, mg/km
    """

    out: Path | None
    steps: Path | None
    page: Path | None
    save: Path | None
    proofs: Path | None
    fronts: bool
    effects: bool
    nox_limit: float | None = None
    _collector: "Collector | None" = field(default=None, init=False)
    _proven: list[tuple[str, Any, Any]] = field(default_factory=list, init=False)
    _driven: list[tuple[Any, Any]] = field(default_factory=list, init=False)

    def check(self, job: ComparisonJob) -> None:
        """DataError, before anything is solved, where a file cannot be written, is an input, or is named twice, and
        for fronts of NOx where an engine has no data on it.
        """
        from hevopt.files.writing import check_outs
        from hevopt.output.file_tables import check_table_file

        if self.proofs is not None:
            from hevopt.output.proof_files import check_folder

            check_folder(self.proofs)
        tables = {"--out": self.out, "--out-steps": self.steps}
        check_outs({"--report": self.page, "--save": self.save, **tables}, job.inputs)
        for path in tables.values():
            if path is not None:
                check_table_file(path)
        if self.fronts:
            from hevopt.studies.nox import require_nox

            for car in job.cars.cars:
                require_nox(car, "--fronts")
        limit = self.nox_limit
        if limit is not None and not 0 < limit < inf:
            raise DataError(f"--nox-limit {limit:g}; allowed: mg/km above 0")
        if self.page is None and self.save is None:
            if limit is not None:
                raise DataError("--nox-limit is drawn on the page; name it with --report or --save")
            if self.fronts or self.effects:
                raise DataError(
                    "--fronts and --sensitivity add to the page; name it with --report or --save"
                )
            return
        from hevopt.pages.comparison.collect import Collector, check_steps
        from hevopt.pages.comparison.room import check_planned
        from hevopt.studies.solved import strategies_for

        check_steps(job.trace)
        cars, steps = job.cars.cars, len(job.trace.time_s) - 1
        rows = sum(len(strategies_for(car, job.settings.strategies, job.brought)) for car in cars)
        check_planned(steps, len(cars), rows)
        self._collector = Collector()

    def observer(self, cold: "ColdStarts | None") -> "Observe":
        """Who takes what files and cold starts need of solved cases: nobody where rows are all."""
        from hevopt.studies.by_car import unobserved

        watching = [of.observe for of in (self._collector, cold) if of is not None]
        if self.proofs is not None or self.steps is not None:
            watching.append(self._observe)
        if not watching:
            return unobserved

        def all_of_them(case: "Case", row: "Row", plan: "Plan", trajectory: "Trajectory") -> None:
            for observe in watching:
                observe(case, row, plan, trajectory)

        return all_of_them

    def _observe(self, case: "Case", row: "Row", plan: "Plan", trajectory: "Trajectory") -> None:
        """Take what proofs and steps need of a solved case."""
        if self.proofs is not None:
            name = f"{case.cycle.name}_{row.architecture}_{row.strategy}"
            self._proven.append((name, trajectory, case.certificate))
        if self.steps is not None:
            from hevopt.output.file_tables import step_frame

            self._driven.append((row, step_frame(case, trajectory)))

    def write(
        self, job: ComparisonJob, comparison: "Comparison"
    ) -> tuple[list[str], dict[str, HevoptError]]:
        """Write all of them; a line for each, and the fronts and sensitivities that failed."""
        from hevopt.output import file_tables as outputs

        lines, failures = self._write_page(job, comparison)
        if self.out is not None:
            outputs.write_rows(self.out, comparison, job.about)
            lines.append(f"rows written to {self.out}")
        if self.steps is not None:
            outputs.write_steps(self.steps, comparison, outputs.joined(self._driven), job.about)
            lines.append(f"steps written to {self.steps}")
        if self.proofs is not None:
            from hevopt.output.proof_files import write_proofs

            count = write_proofs(self.proofs, self._proven)
            lines.append(
                f"{count} proofs written to {self.proofs}; tools/check_proof.py checks them"
            )
        return lines, failures

    def _write_page(
        self, job: ComparisonJob, comparison: "Comparison"
    ) -> tuple[list[str], dict[str, HevoptError]]:
        if self._collector is None:
            return [], {}
        from hevopt.pages.comparison.compared import Extras, with_studies, write_files

        results = self._collector.results(
            comparison,
            command_line(),
            changes=job.cars.said(),
            others=job.others,
            published=job.is_study,
        ).model_copy(update={"nox_limit_mg_per_km": self.nox_limit})
        extras = Extras(job.cars, job.trace, job.settings, self.fronts, self.effects)
        with Progress() as progress:
            results, failures = with_studies(results, extras, progress)
        return write_files(results, self.page, self.save), failures


def show_rows(job: ComparisonJob, comparison: "Comparison", *, wide: bool) -> None:
    """Print the rows as a table with notes; wide: all columns, however narrow the terminal."""
    from hevopt.output import terminal_tables as report

    columns = None if wide else width()
    rows = report.comparison_table(comparison, columns)
    show(rows)
    left = report.left_out(comparison, rows)
    notes = [f"left out for want of width: {', '.join(left)}; --wide shows them."] if left else []
    show_notes("\n".join([*notes, report.comparison_notes(comparison, left), *job.cars.said()]))
    if job.cold is not None:
        from hevopt.output.cold_tables import cold_table

        show(cold_table(job.cold))


def ready_to_show(job: ComparisonJob) -> None:
    """Load what `show_comparison` writes tables with, by writing some without rows."""
    from hevopt.output.beside_tables import published_table
    from hevopt.output.terminal_tables import comparison_table
    from hevopt.studies.comparison import Comparison

    nothing = Comparison(job.trace.name, [])
    text_of(comparison_table(nothing))
    if job.is_study:
        published_table(nothing)


def show_comparison(
    job: ComparisonJob, comparison: "Comparison", *, json: bool, wide: bool
) -> None:
    """Print the rows as a table with notes and published figures, or as JSON."""
    from hevopt.output import file_tables as outputs
    from hevopt.output.beside_tables import published_table

    if json:
        write(outputs.result_json(comparison, job.about))
        return
    show_rows(job, comparison, wide=wide)
    write("")
    published = published_table(comparison, None if wide else width()) if job.is_study else None
    if published is not None:
        show(published)
