"""The program `study`, and run_study(): many runs of a scene, computed by any executor.

A row is a pure function of the study and the index of its run, so that results do not depend on
the executor. Rows are appended to a file as they arrive; an interrupted study continues there.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import fcntl
import functools
import io
import json
import math
import os
import re
import signal
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from ._command import (
    EXIT_DONE,
    Parser,
    SceneFile,
    UsageError,
    count,
    jobs,
    printable,
    require,
    require_compiled,
    run_program,
    say,
    writing,
    written,
)
from ._errors import Error, InputError
from ._studies import Study, read_study, study_from_rows
from ._version import __version__

if TYPE_CHECKING:
    from ._study_file import StudyRuns

SECONDS_OF_A_CHUNK = 1.0
ROWS_OF_A_CHUNK = 16384
SECONDS_BETWEEN_SYNCS = 10.0


class Range(NamedTuple):
    """Indices first, ..., end - 1."""

    first: int
    end: int


class Chunk(NamedTuple):
    """Rows of consecutive runs."""

    first: int
    text: str
    runs: int
    failures: int
    seconds: float


# --- computation


def _runs_of(study: str | os.PathLike[str]) -> StudyRuns:
    require_compiled("a study")
    from ._study_file import StudyRuns

    return StudyRuns(study)


@functools.lru_cache(maxsize=4)
def _study_of(file: str, expected: str) -> StudyRuns:
    """The study of a worker; `expected` is the hash of the study that it shall compute."""
    runs = _runs_of(file)
    if runs.manifest["hash"] != expected:
        raise InputError(f"{file}: is another one, or of another scene, on {os.uname().nodename}")
    return runs


@functools.lru_cache(maxsize=1)
def _end_with_parent(worker: int) -> None:
    """Lets the system end this process with the one that started it.

    A worker of a ProcessPoolExecutor outlives a killed parent otherwise.
    """
    import multiprocessing

    if multiprocessing.parent_process() is not None and sys.platform == "linux":
        parent_death_signal = 1  # PR_SET_PDEATHSIG of prctl(2)
        ctypes.CDLL(None).prctl(parent_death_signal, signal.SIGKILL)


def _compute(study: StudyRuns, first: int, end: int) -> Chunk:
    begin = time.perf_counter()
    text, runs, failures = study.rows(first, end)
    return Chunk(first, text, runs, failures, time.perf_counter() - begin)


def _compute_in_worker(file: str, expected: str, first: int, end: int) -> Chunk:
    _end_with_parent(os.getpid())
    return _compute(_study_of(file, expected), first, end)


@dataclass
class Progress:
    """Runs of a study that are done, and the time that they took."""

    total: int
    before: int
    workers: int
    done: int = 0
    failures: int = 0
    busy: float = 0.0  # computing time of all workers [s]
    begin: float = field(default_factory=time.perf_counter)

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self.begin

    def __str__(self) -> str:
        rate = self.done / max(self.seconds, 1e-9)
        done = self.before + self.done
        left = (
            f", {_duration((self.total - done) / rate)} left"
            if 0 < done < self.total and rate
            else ""
        )
        return f"{done} of {self.total} runs, {rate:.3g} per second{left}, {self.failures} failed"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(math.ceil(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours >= 48:
        return f"{hours / 24:.1f} days"
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def _run_all(
    runs: StudyRuns,
    missing: list[Range],
    executor: Executor | None,
    progress: Progress,
    write: Callable[[Chunk], None],
    *,
    chunk: int = 0,
    show: Callable[[Progress], None] = lambda progress: None,
) -> None:
    """Computes the missing runs and writes each chunk of rows as it arrives.

    executor: None: threads of this process, since compiled runs do not hold the interpreter's lock;
    after an interruption they complete their runs. chunk: number of runs in a chunk, 0: as many as
    take a second.
    """
    manifest = runs.manifest
    pool: Executor = executor or ThreadPoolExecutor(progress.workers)
    task = functools.partial(_compute, runs)
    if executor is not None:
        file = os.path.abspath(manifest["study"]["file"])
        task = functools.partial(_compute_in_worker, file, manifest["hash"])
    longest = max(ROWS_OF_A_CHUNK // runs.rows_of_run, 1)
    ranges = missing[::-1]
    cost = 0.0  # of a run [s]
    waiting: set[Future[Chunk]] = set()

    def submit() -> None:
        # The first chunks are single runs, since their cost is unknown. At the end chunks shrink,
        # so that all workers end at about the same time.
        left = sum(part.end - part.first for part in ranges)
        by_time = SECONDS_OF_A_CHUNK / cost if cost else 1
        size = chunk or max(1, min(int(by_time), left // (4 * progress.workers), longest))
        first, end = ranges.pop()
        if first + size < end:
            ranges.append(Range(first + size, end))
        waiting.add(pool.submit(task, first, min(first + size, end)))

    def collect(ready: set[Future[Chunk]]) -> None:
        nonlocal cost
        for future in ready:
            result = future.result()
            if not result.runs:
                continue
            write(result)
            progress.done += result.runs
            progress.failures += result.failures
            progress.busy += result.seconds
            mean = result.seconds / result.runs
            cost = 0.5 * (cost + mean) if cost else mean

    try:
        while ranges or waiting:
            while ranges and len(waiting) < 2 * progress.workers:
                submit()
            ready, waiting = wait(waiting, timeout=0.5, return_when=FIRST_COMPLETED)
            collect(ready)
            show(progress)
    except BrokenExecutor as error:
        raise Error(f"a worker ended: {error}") from None
    except BaseException as error:
        under_way = {future for future in waiting if not future.cancel()}
        if executor is None:
            runs.stop()
            ready, _ = wait(under_way)
            if not isinstance(error, OSError):  # else rows cannot be written
                collect({future for future in ready if not future.exception()})
        raise
    finally:
        if executor is None:
            pool.shutdown()


# --- files of rows


class Segment(NamedTuple):
    """Complete runs with consecutive indices in a file, and their bytes begin, ..., end - 1."""

    runs: Range
    file: Path
    begin: int
    end: int
    failures: int


@dataclass(frozen=True)
class Layout:
    """Format of the rows of a study."""

    columns: list[str]
    rows_of_run: int

    @property
    def header(self) -> str:
        return ",".join(self.columns) + "\n"

    def place(self, line: str) -> tuple[int, bool, bool, bool] | None:
        """Index of a row, whether it is the first and the last one of its run, and has failed."""
        fields = line.split(",")
        if len(fields) != len(self.columns) or not fields[0].isdecimal():
            return None
        failed = bool(fields[-1])
        if "n" not in self.columns:
            return int(fields[0]), True, True, failed
        n = fields[self.columns.index("n")]
        if not n.isdecimal() or (int(n) == 0) != failed:
            return None
        return int(fields[0]), int(n) <= 1, int(n) in (0, self.rows_of_run), failed


def read_rows(file: Path, layout: Layout, allowed: Range) -> list[Segment]:
    """Finds the complete runs of a file of rows, in its order; what follows the last one was torn.

    Raises InputError for a row that is not of this study, with its line.
    """
    segments: list[Segment] = []
    if not file.exists():
        return segments

    def refuse(what: str) -> NoReturn:
        advice = "it is no file of this study: move it away, or use another --output"
        raise InputError(f"{file}:{number}: {what}; {advice}")

    at, begin = 0, 0
    before: int | None = None  # index of a run whose last row is missing
    with open(file, "rb") as stream:
        for number, line in enumerate(stream, start=1):
            if not line.endswith(b"\n"):
                break
            text = line.decode("utf-8", "replace")
            at += len(line)
            if number == 1:
                if text != layout.header:
                    refuse("has another header")
                begin = at
                continue
            row = layout.place(text[:-1])
            if row is None:
                refuse("is no row")
            index, first, last, failed = row
            if (index != before or first) if before is not None else not first:
                refuse("does not follow the row before it")
            if not allowed.first <= index < allowed.end:
                refuse(f"has index {index}")
            before = None if last else index
            if not last:
                continue
            segment = Segment(Range(index, index + 1), file, begin, at, int(failed))
            if segments and segments[-1].runs.end == index:
                (start, _), _, begin, _, failures = segments.pop()
                segment = Segment(Range(start, index + 1), file, begin, at, failures + failed)
            segments.append(segment)
            begin = at
    return segments


def missing_ranges(allowed: Range, done: list[Range]) -> list[Range]:
    """The parts of `allowed` that are not in `done`."""
    missing, first = [], allowed.first
    for part in sorted(done):
        if part.first > first:
            missing.append(Range(first, part.first))
        first = max(first, part.end)
    return [*missing, *([Range(first, allowed.end)] if first < allowed.end else [])]


class RowFile:
    """A file to which rows are appended, locked against other processes."""

    def __init__(self, file: Path) -> None:
        self._name = str(file)
        try:
            self._stream = open(file, "ab", buffering=0)
        except OSError as error:
            raise OSError(f"{file}: {error.strerror}") from None
        self._synced = time.monotonic()
        try:
            fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._stream.close()
            raise UsageError(f"{file}: another process is at this study") from None

    @property
    def size(self) -> int:
        return os.fstat(self._stream.fileno()).st_size

    def go_on(self, end: int, header: str) -> None:
        """Cuts the file after its complete runs, and writes the header if there are none."""
        self._stream.truncate(end)
        if not end:
            self.append(header)

    def append(self, text: str) -> None:
        """What a full disk leaves of them, go_on() cuts."""
        rest = text.encode()
        with writing(self._name):
            while rest:
                rest = rest[self._stream.write(rest) :]
            if time.monotonic() - self._synced > SECONDS_BETWEEN_SYNCS:
                os.fdatasync(self._stream.fileno())
                self._synced = time.monotonic()

    def close(self) -> None:
        if not self._stream.closed:
            os.fdatasync(self._stream.fileno())
            self._stream.close()


def _merge(segments: list[Segment], layout: Layout, file: Path) -> None:
    """Writes the rows of all segments in order of index; the file appears when it is complete."""
    block = 1 << 20
    with written(file) as temporary, open(temporary, "wb") as output:
        output.write(layout.header.encode())
        for _, name, begin, end, _ in sorted(segments):
            with open(name, "rb") as source:
                source.seek(begin)
                for at in range(begin, end, block):
                    rows = source.read(min(block, end - at))
                    if len(rows) < min(block, end - at):
                        raise OSError(f"{name}: cannot be read: it became shorter")
                    output.write(rows)
        output.flush()
        os.fdatasync(output.fileno())


# --- the folder of a study


class Folder:
    """The files of a study, or of a part of it, in a folder."""

    def __init__(self, runs: StudyRuns, folder: Path, shard: tuple[int, int] | None = None) -> None:
        self.study = runs.manifest
        self.shard = shard or (1, 1)
        self.whole = shard is None
        self.folder = folder
        stem = "rows" if self.whole else f"shard-{self.shard[0]}-of-{self.shard[1]}"
        self.rows = folder / f"{stem}.csv"
        self.partly = folder / f"{stem}.part.csv"
        self.manifest_file = folder / ("manifest.json" if self.whole else f"{stem}.json")
        self.layout = Layout(self.study["columns"], runs.rows_of_run)
        self.indices = self._part(self.shard)
        self._segments: list[Segment] = []
        self._output: RowFile | None = None

    def _part(self, shard: tuple[int, int]) -> Range:
        i, n = shard
        total = self.study["points"] * self.study["runs"]
        return Range(total * (i - 1) // n, total * i // n)

    def manifest(self, workers: int, finished: bool) -> dict[str, Any]:
        return {
            **self.study,
            "version": __version__,
            "shard": list(self.shard),
            "indices": list(self.indices),
            "workers": workers,
            "finished": finished,
        }

    def _write_manifest(self, workers: int, finished: bool) -> None:
        text = json.dumps(self.manifest(workers, finished), indent=2, ensure_ascii=False)
        with written(self.manifest_file) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8", errors="replace")

    def _check_manifest(self, file: Path, expected: dict[str, Any]) -> None:
        """Refuses a folder of another study."""
        if not file.exists():
            return
        advice = "move the folder away, or use another --output"
        try:
            there = json.loads(file.read_bytes())
        except ValueError:
            there = None
        if not isinstance(there, dict):
            raise InputError(f"{file}: is no manifest of a study; {advice}")
        for key in ("hash", "version", "compiler", "shard", "indices"):
            was, now = json.dumps(there.get(key)), json.dumps(expected[key])
            if was != now:
                named = "study, scene or files" if key == "hash" else key
                raise InputError(
                    f"{file}: belongs to another study: its {named} differs ({was}, now {now}); "
                    f"{advice}"
                )

    def open(self, workers: int) -> None:
        """Finds the rows that are there, and opens the file of the others."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            raise UsageError(
                f"--output: {self.folder} is no folder and cannot be made one"
            ) from None
        self._check_manifest(self.manifest_file, self.manifest(workers, False))
        for file in (self.rows, self.partly):
            if file.exists() and not self.manifest_file.exists():
                advice = "move it away, or use another --output"
                raise InputError(f"{file}: is there without a manifest; {advice}")
        if self.rows.exists():
            return
        if self.whole:
            self._segments = self._shards()
        self._write_manifest(workers, False)
        self._output = RowFile(self.partly)
        own = read_rows(self.partly, self.layout, self.indices)
        self._output.go_on(own[-1].end if own else 0, self.layout.header)
        self._segments += own
        segments = sorted(self._segments)
        for a, b in zip(segments, segments[1:]):
            if b.runs.first < a.runs.end:
                twice = f"has run {b.runs.first}, which {a.file} has too; remove one of them"
                raise InputError(f"{b.file}: {twice}")

    def _shards(self) -> list[Segment]:
        """The parts in the folder, finished or not."""
        segments = []
        for file in sorted(self.folder.glob("shard-*.json")):
            match = re.fullmatch(r"shard-(\d{1,9})-of-(\d{1,9})\.json", file.name)
            shard = (int(match[1]), int(match[2])) if match else (0, 0)
            if not 1 <= shard[0] <= shard[1]:
                continue
            indices = self._part(shard)
            expected = {"shard": list(shard), "indices": list(indices)}
            self._check_manifest(file, {**self.manifest(1, False), **expected})
            rows, partly = file.with_suffix(".csv"), file.with_suffix(".part.csv")
            if not rows.exists() and partly.exists():
                RowFile(partly).close()  # refuses a part that another process computes
                rows = partly
            if rows.exists():
                segments += read_rows(rows, self.layout, indices)
        return segments

    @property
    def size(self) -> int:
        """Number of runs of the study, or of its part."""
        return self.indices.end - self.indices.first

    @property
    def failures(self) -> int:
        """Failed runs among the rows that are there."""
        return sum(segment.failures for segment in self._segments)

    @property
    def finished(self) -> bool:
        return self._output is None

    def missing(self) -> list[Range]:
        if self._output is None:
            return []
        return missing_ranges(self.indices, [segment.runs for segment in self._segments])

    def progress(self, workers: int) -> Progress:
        missing = sum(part.end - part.first for part in self.missing())
        return Progress(self.size, self.size - missing, workers)

    def append(self, chunk: Chunk) -> None:
        assert self._output is not None
        runs, begin = Range(chunk.first, chunk.first + chunk.runs), self._output.size
        self._output.append(chunk.text)
        end = self._output.size
        self._segments.append(Segment(runs, self.partly, begin, end, chunk.failures))

    def complete(self, workers: int) -> None:
        """Sorts the rows and finishes the study."""
        if self._output is None:
            return
        self._output.close()
        own = all(segment.file == self.partly for segment in self._segments)
        if own and self._segments == sorted(self._segments):
            self.partly.replace(self.rows)
        else:
            _merge(self._segments, self.layout, self.rows)
            self.partly.unlink()
        self._write_manifest(workers, True)

    def close(self) -> None:
        if self._output is not None:
            self._output.close()


def run_study(
    study: str | os.PathLike[str],
    executor: Executor | None = None,
    *,
    jobs: int | None = None,
    output: str | os.PathLike[str] | None = None,
) -> Study:
    """Runs the study of a study file, or one that comes with Sprag by its name.

    The rows are those that `sprag study` writes. executor: any concurrent.futures.Executor, for
    example a ProcessPoolExecutor, mpi4py.futures.MPIPoolExecutor() or a Dask client's
    get_executor(); None: threads of this process. jobs: number of threads, or of the executor's
    workers; None: one for each core. output: folder of the rows, where an interrupted study
    continues; None: in memory. Raises SceneError or InputError for a wrong study file or scene, and
    Error if a worker ended. A run that fails has its reason in the column failure.
    """
    if jobs is not None and jobs < 1:
        raise ValueError("jobs must be >= 1")
    workers = jobs or os.cpu_count() or 1
    runs = _runs_of(study)
    for remark in runs.study.remarks:
        warnings.warn(remark, RuntimeWarning, stacklevel=2)
    if output is not None:
        with contextlib.closing(Folder(runs, Path(output))) as folder:
            folder.open(workers)
            _run_all(runs, folder.missing(), executor, folder.progress(workers), folder.append)
            folder.complete(workers)
        return read_study(output)
    manifest = runs.manifest
    everything = Range(0, manifest["points"] * manifest["runs"])
    chunks: list[Chunk] = []
    progress = Progress(everything.end, 0, workers)
    _run_all(runs, [everything], executor, progress, chunks.append)
    text = "".join(chunk.text for chunk in sorted(chunks))
    return study_from_rows(io.StringIO(f"{','.join(manifest['columns'])}\n{text}"), manifest)


# --- the program


def _shard(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text)
    i, n = (int(match[1]), int(match[2])) if match else (0, 0)
    if not 1 <= i <= n:
        raise argparse.ArgumentTypeError(f"{text} is not allowed; must be i/n with 1 <= i <= n")
    return i, n


class _ProgressLine:
    """Progress on stderr: on a terminal an updated line, else a line per minute."""

    def __init__(self) -> None:
        self._terminal = sys.stderr.isatty()
        self._shown = 0.0
        self._width = 0

    def show(self, progress: Progress) -> None:
        if progress.seconds - self._shown >= (0.5 if self._terminal else 60.0):
            self._shown = progress.seconds
            self._print(progress)

    def last(self, progress: Progress) -> None:
        self._print(progress)
        if self._terminal:
            print(file=sys.stderr)

    def _print(self, progress: Progress) -> None:
        line = str(progress)
        if self._terminal:
            print(f"\r{line:{self._width}}", end="", file=sys.stderr, flush=True)
            self._width = len(line)
        else:
            say("study", line)


@contextlib.contextmanager
def _executor(options: argparse.Namespace) -> Iterator[tuple[Executor | None, int]]:
    """The executor that the command line chooses, and its number of workers.

    No executor: threads, or with --mpi this process is a worker that has ended its work.
    """
    if options.mpi:
        futures = require("mpi4py.futures", "python3-mpi4py openmpi-bin", "--mpi")
        world = require("mpi4py.MPI", "python3-mpi4py openmpi-bin", "--mpi").COMM_WORLD
        with futures.MPICommExecutor(world, root=0) as executor:
            yield executor, max(world.size - 1, 1)
    elif options.dask:
        distributed = require("distributed", "python3-distributed", "--dask")
        try:
            client = distributed.Client(options.dask, timeout="10s", set_as_default=False)
        except (OSError, ValueError) as error:
            raise Error(f"--dask: {options.dask}: no scheduler answers: {error}") from None
        with client:
            client.wait_for_workers(1)
            yield client.get_executor(pure=False), sum(client.nthreads().values())
    else:
        yield None, options.jobs or os.cpu_count() or 1


def _folder_named(study: dict[str, Any]) -> Path:
    """The name of a study must not be a path that leads out of the working directory."""
    name = study["name"]
    if name and printable(name) == name and "/" not in name and name not in (".", ".."):
        return Path(name)
    raise UsageError(
        f'{study["study"]["file"]}: name is "{printable(name)}", which no folder in the working '
        "directory can have; use --output FOLDER"
    )


def _refuse_overwriting(runs: StudyRuns, folder: Folder, report: str | None) -> None:
    given = [runs.manifest["study"]["file"], *runs.study.inputs, *([report] if report else [])]
    for file in (folder.rows, folder.partly, folder.manifest_file):
        for other in given:
            if os.path.realpath(file) == os.path.realpath(other):
                raise UsageError(f"--output: {file} would overwrite {other}")


def _run(options: argparse.Namespace, report: dict[str, Any]) -> int:
    if options.mpi and options.dask:
        raise UsageError("choose --mpi or --dask")
    if options.jobs and (options.mpi or options.dask):
        raise UsageError("--jobs is for threads; --mpi and --dask have workers of their own")
    if not options.mpi and int(os.environ.get("OMPI_COMM_WORLD_SIZE", "1")) > 1:
        raise UsageError("under mpirun give --mpi")
    require_compiled("study")
    with _executor(options) as (executor, workers):
        if options.mpi and executor is None:
            options.report = None  # the first rank writes it
            return EXIT_DONE
        runs = _runs_of(options.STUDY)
        for remark in runs.study.remarks:
            print(printable(remark), file=sys.stderr)
        output = Path(options.output) if options.output else _folder_named(runs.manifest)
        folder = Folder(runs, output, options.shard)
        _refuse_overwriting(runs, folder, options.report)
        with contextlib.closing(folder):
            folder.open(workers)
            _run_folder(options, runs, folder, executor, workers, report)
    return EXIT_DONE


def _run_folder(
    options: argparse.Namespace,
    runs: StudyRuns,
    folder: Folder,
    executor: Executor | None,
    workers: int,
    report: dict[str, Any],
) -> None:
    progress, line = folder.progress(workers), _ProgressLine()
    more: dict[str, Any] = {"chunk": options.chunk or 0, "show": line.show}
    try:
        _run_all(runs, folder.missing(), executor, progress, folder.append, **more)
        if not folder.finished:
            report["failed"] = folder.failures
        folder.complete(workers)
    except BaseException:
        kept = f"the runs that are done are kept in {folder.partly}; the same command goes on"
        say("study", kept)
        raise
    finally:
        line.last(progress)
        report.update(
            study=runs.manifest["name"],
            rows=str(folder.rows),
            points=runs.manifest["points"],
            runs=folder.size,
            before=progress.before,
            done=progress.done,
            workers=workers,
            seconds=progress.seconds,
            computing_seconds=progress.busy,
        )
        if progress.done:
            # Time of all workers outside of runs.
            idle = progress.seconds * workers - progress.busy
            report["overhead_seconds_per_run"] = idle / progress.done


def main() -> int:
    parser = Parser(
        "study",
        "Runs the study of a study file: a scene of which keys, disturbances of the events and "
        "starts vary. Rows go to DIR/rows.csv. A study that was ended goes on where it was when it "
        "is started again. Threads compute, or the workers of MPI or Dask.",
    )
    add = parser.add_argument
    text = "Study file, or the name of one that comes with Sprag"
    add("STUDY", type=SceneFile, help=text)
    add("--output", metavar="DIR", help="folder of the results; default the study's name")
    text = "run the i-th of n equal parts alone, with files of its own"
    add("--shard", metavar="i/n", type=_shard, help=text)
    add("--jobs", metavar="n", type=jobs, help="threads; default: all cores")
    text = "run on the ranks of mpirun; the first one hands out"
    add("--mpi", action="store_true", help=text)
    add("--dask", metavar="ADDRESS", help="run on the workers of this Dask scheduler")
    text = "hand out and write so many runs together; default as many as take a second"
    add("--chunk", metavar="n", type=count, help=text)
    return run_program(parser, _run)
