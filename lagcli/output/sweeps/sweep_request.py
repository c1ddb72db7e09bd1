"""A request for the files of a sweep, who computes it, and what is refused about them."""

from __future__ import annotations

import dataclasses
import os
import pathlib
from collections.abc import Iterable

from lagcli.output.files import file_requests, formats
from lagcli.output.files.write_guard import BadRequest


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SweepRequest:
    """Options of `sweep` besides what is computed: files, and who computes."""

    output: str | None
    tables: str | None
    shard: str | None
    scheduler: str | None
    jobs: int
    resume: bool
    as_json: bool
    quiet: bool

    @property
    def target(self) -> str | None:
        """The file or, with a stroke at its end, the folder of a dataset; None for standard output."""
        return None if self.output in (None, "-") else self.output

    @property
    def is_dataset(self) -> bool:
        """True if the rows are one part of a folder."""
        name = self.target or ""
        return name.endswith(("/", os.sep)) or os.path.isdir(name)

    @property
    def part(self) -> tuple[int, int]:
        """The numbers of `--shard I/N`, 1 of 1 without it. Raises `BadRequest`."""
        if self.shard is None:
            return 1, 1
        number, sign, count = (part.strip() for part in self.shard.partition("/"))
        is_count = sign and number.isdecimal() and count.isdecimal()
        if not is_count or not 1 <= int(number) <= int(count):
            raise BadRequest(f"--shard {self.shard}: write I/N, the part I of N, from 1/N to N/N")
        return int(number), int(count)

    @property
    def path(self) -> pathlib.Path:
        """The file of this shard."""
        assert self.target is not None
        if self.is_dataset:
            number, count = self.part
            return pathlib.Path(self.target) / f"part-{number:05d}-of-{count:05d}.parquet"
        return pathlib.Path(self.target)

    @property
    def rows_so_far(self) -> pathlib.Path:
        """The name that the rows of an interrupted sweep get, before `.partial`. In a folder it begins with a dot: what
        reads a dataset passes over such files, and over no others."""
        path = self.path
        return path.with_name(f".{path.name}") if self.is_dataset else path

    def require(self, model: str, points: str | None) -> None:
        """Refuse what cannot be done for this MODEL and these points. Raises `BadRequest`, `write_guard.WriteError`."""
        if model == points == "-":
            raise BadRequest("standard input can be read once only: MODEL and --points are both -")
        if self.scheduler is not None and self.jobs != 1:
            raise BadRequest("--jobs and --scheduler both say who computes; give one of them")
        if self.target is None:
            if self.resume:
                raise BadRequest("--resume goes on in the file of the sweep before: give it with -o FILE")
            if self.as_json:
                raise BadRequest("--json has standard output: give a file for the rows with -o FILE")
        elif not self.is_dataset:
            file_requests.require_outputs(model, self.output, None, self.as_json)
            if points not in (None, "-"):
                file_requests.require([("--points", points)], ("--output", self.target, formats.TABLES))

    def require_merge(self, paths: Iterable[str]) -> None:
        """Refuse what cannot be done with the tables of these shards."""
        if self.target is None and self.as_json:
            raise BadRequest("--json has standard output: give a file for the rows with -o FILE")
        if self.target is None:
            return
        if self.is_dataset:
            raise BadRequest(f"--merge: {self.target} is a folder; the parts of a dataset need no merging")
        file_requests.require(
            [("--merge", path) for path in paths], ("--output", self.target, formats.TABLES)
        )
