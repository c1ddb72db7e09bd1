"""Files that are written: never over an input, and as careful programs treat links, permissions and owners."""

import errno
import json
import os
import stat
import sys
from pathlib import Path

import pytest

import lagcli
from lagcli.output.files import atomic_file, write_guard
from lagcli.output.tables import csv_format, sinks
from lagcli.running import run_tables, written_run
from tests.helpers import in_process, pendulum
from tests.helpers.in_process import command

__all__ = ["command"]

PENDULUM = pendulum.PENDULUM + "simulation: {duration: 0.5, samples: 6}\n"
KNIFE = """\
lagcli: 1
coordinates: {x: {rate: 1}, y: {}, theta: {rate: 1}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(theta)**2)/2
differential: {edge: "sin(theta)*d(x) - cos(theta)*d(y) = 0"}
"""
posix = pytest.mark.skipif(os.name != "posix", reason="owners and permissions of POSIX")
root = pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root gives files away")


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder with a model, and inputs whose names end like figures, tables and checkpoints."""
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(PENDULUM)
    for name in ("m.png", "m.csv", "m.json", "run.csv.partial"):
        Path(name).write_text(PENDULUM)
    Path("knife.svg").write_text(KNIFE)
    return tmp_path


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


# No output is an input.

OVER = {
    "table": ("simulate m.csv -o m.csv", "MODEL"),
    "figure": ("simulate m.png --plot m.png", "MODEL"),
    "account": ("simulate m.json --stats m.json -o run.csv", "MODEL"),
    "checkpoint": ("simulate m.json --checkpoint m.json", "MODEL"),
    "partial": ("simulate run.csv.partial -o run.csv", "MODEL"),
    "figure of an audit": ("audit m.png --plot m.png", "MODEL"),
    "figure of a loop": ("check knife.svg --witness edge --plot knife.svg", "MODEL"),
    "another spelling": ("simulate ./m.png --plot ../{folder}/m.png", "MODEL"),
    "partial and checkpoint": ("simulate m.yaml -o run.csv --checkpoint run.csv.partial", "--checkpoint"),
    "partial and account": ("simulate m.yaml -o run.csv --stats run.csv.partial", "--stats"),
}


@pytest.mark.parametrize(("line", "whose"), OVER.values(), ids=OVER)
def test_no_option_writes_over_a_file_of_the_same_command(command, here, line, whose):
    before = contents(here)
    out, err, code = command(*line.format(folder=here.name).split())
    assert (out, code) == ("", 2), err
    assert whose in err
    assert contents(here) == before


@posix
@pytest.mark.parametrize("link", ["symbolic", "hard", "to a link"])
@pytest.mark.parametrize(
    ("line", "target"),
    [
        ("simulate {model} --plot {other}", "m.png"),
        ("simulate {model} -o {other}", "m.csv"),
        ("simulate {model} --stats {other} -o x.csv", "m.json"),
        ("audit {model} --plot {other}", "m.png"),
        ("check {model} --witness edge --plot {other}", "knife.svg"),
    ],
)
def test_an_input_is_known_through_links(command, here, link, line, target):
    other = Path(f"other{Path(target).suffix}")
    if link == "hard":
        other.hardlink_to(target)
    else:
        Path("between").symlink_to(target)
        other.symlink_to("between" if link == "to a link" else target)
    before = contents(here)
    out, err, code = command(*line.format(model=target, other=other).split())
    assert (out, code) == ("", 2)
    assert "that is the file of MODEL" in err
    assert contents(here) == before


def test_a_table_that_is_read_is_not_written(command, here):
    assert command("simulate", "m.yaml", "-q", "-o", "table.csv")[2] == 0
    assert command("audit", "m.yaml", "--run", "table.csv", "--plot", "table.csv")[2] == 2
    Path("table.png").symlink_to("table.csv")
    _, err, code = command("audit", "m.yaml", "--run", "table.csv", "--plot", "table.png")
    assert code == 2
    assert "that is the file of --run" in err


@posix
@pytest.mark.parametrize("option", ["--stats", "--checkpoint"])
def test_a_model_on_standard_input_is_a_file_too(here, option, monkeypatch, command):
    with open("m.json") as model:
        monkeypatch.setattr(sys, "stdin", model)
        _, err, code = command("simulate", "-", option, "m.json", "-o", "run.csv")
    assert code == 2
    assert f"{option} m.json: that is the file of MODEL" in err
    assert Path("m.json").read_text() == PENDULUM


@posix
def test_standard_output_is_a_file_too(here, monkeypatch):
    with open("all.json", "w") as out:
        monkeypatch.setattr(sys, "stdout", out)
        told = [write_guard.File("--stats", "all.json", is_written=True), *write_guard.stdout()]
        with pytest.raises(write_guard.BadRequest, match="that is the file of --stats"):
            write_guard.require_separate(told)


@pytest.mark.parametrize(("platform", "refused"), [("linux", False), ("darwin", True), ("win32", True)])
def test_names_that_differ_in_case_are_one_file_where_the_system_takes_them_so(
    here, platform, refused, monkeypatch
):
    monkeypatch.setattr(sys, "platform", platform)
    pair = [
        write_guard.File("--stats", "new.json", True),
        write_guard.File("--checkpoint", "NEW.json", True),
    ]
    if refused:
        with pytest.raises(write_guard.BadRequest):
            write_guard.require_separate(pair)
    else:
        write_guard.require_separate(pair)


def test_two_models_may_be_one_file(command, here):
    assert command("check", "m.yaml", "./m.yaml", "-q")[2] == 0


# Links.


@posix
def test_a_link_to_itself_is_an_error_and_stays(command, here):
    Path("loop.csv").symlink_to("loop.csv")
    Path("a.csv").symlink_to("b.csv")
    Path("b.csv").symlink_to("a.csv")
    for name in ("loop.csv", "a.csv"):
        out, err, code = command("simulate", "m.yaml", "-o", name)
        assert (out, code) == ("", 74)
        assert err.startswith(f"lagcli: cannot write {name}: ")
        assert Path(name).is_symlink()


@posix
@pytest.mark.parametrize("option", ["-o", "--plot", "--stats", "--checkpoint"])
def test_a_link_of_somebody_else_in_a_shared_folder_is_not_followed(command, here, option, monkeypatch):
    shared = here / "shared"
    shared.mkdir()
    ending = {"-o": "csv", "--plot": "png"}.get(option, "json")
    victim, link = here / "victim", shared / f"out.{ending}"
    victim.write_text("mine")
    link.symlink_to(victim)
    shared.chmod(0o1777)
    # The same folder with the link owned by somebody who owns neither the folder nor the run.
    monkeypatch.setattr(atomic_file, "_user", lambda: os.geteuid() + 1)
    real = Path.stat

    def foreign(path, **how):
        found = real(path, **how)
        if path == shared:
            return os.stat_result((found.st_mode, *found[1:4], found.st_uid + 2, *found[5:]))
        return found

    monkeypatch.setattr(Path, "stat", foreign)
    out, err, code = command("simulate", "m.yaml", option, str(link))
    assert (out, code) == ("", 74)
    assert "a link of somebody else" in err
    assert victim.read_text() == "mine"
    assert [path.name for path in shared.iterdir()] == [link.name]


@root
def test_root_does_not_follow_a_strangers_link(command, here):
    shared = here / "shared"
    shared.mkdir()
    victim, link = here / "victim", shared / "out.csv"
    victim.write_text("mine")
    link.symlink_to(victim)
    os.chown(link, 54321, 54321, follow_symlinks=False)
    shared.chmod(0o1777)
    assert command("simulate", "m.yaml", "-o", str(link))[2] == 74
    assert victim.read_text() == "mine"
    shared.chmod(0o777)  # not sticky: whoever may write there may replace everything anyway
    assert command("simulate", "m.yaml", "-q", "-o", str(link))[2] == 0
    assert link.is_symlink()


def status(mode=0o644, user=1, group=1):
    return os.stat_result((mode, 0, 0, 0, user, group, 0, 0, 0, 0))


STICKY, OPEN = 0o41777, 0o40777


@pytest.mark.parametrize(
    ("link", "folder", "user", "expected"),
    [
        (2, status(STICKY, user=0), 1, True),
        (2, status(STICKY, user=0), 0, True),
        (1, status(STICKY, user=0), 1, False),  # one's own
        (0, status(STICKY, user=0), 1, False),  # of the owner of the folder
        (2, status(OPEN, user=0), 1, False),
        (2, status(0o41755, user=0), 1, False),
        (2, status(STICKY, user=0), None, False),  # a system without numbers of users
    ],
)
def test_links_are_followed_as_linux_does_with_protected_symlinks(link, folder, user, expected):
    assert atomic_file.is_foreign(status(0o120777, user=link), folder, user) is expected


# Permissions and owners.


@posix
@pytest.mark.parametrize("option", ["-o", "--plot", "--stats", "--checkpoint"])
@pytest.mark.parametrize("through", ["name", "link"])
def test_a_write_protected_file_is_refused_before_the_run(command, here, option, through, monkeypatch):
    from lagcli.api import prepare_run

    ending = {"-o": "csv", "--plot": "png"}.get(option, "json")
    old = here / f"old.{ending}"
    old.write_text("old")
    old.chmod(0o444)
    name = old.name
    if through == "link":
        name = f"link.{ending}"
        Path(name).symlink_to(old)
    monkeypatch.setattr(prepare_run, "prepare", None)
    out, err, code = command("simulate", "m.yaml", option, name)
    assert (out, code) == ("", 74)
    assert err == f"lagcli: cannot write {name}: it is write-protected\n"
    assert old.read_text() == "old"
    old.chmod(0o644)
    monkeypatch.undo()


@posix
def test_a_write_protected_partial_file_is_refused_before_the_run(command, here):
    Path("run.csv.partial").chmod(0o400)
    _, err, code = command("simulate", "m.yaml", "-o", "run.csv")
    assert code == 74
    assert "run.csv.partial: it is write-protected" in err
    assert sorted(path.name for path in here.glob("run*")) == ["run.csv.partial"]


@posix
@pytest.mark.parametrize(
    ("file", "folder", "user", "expected"),
    [
        (status(0o100644, user=5), status(0o40755, user=5), 5, ""),
        (status(0o100444, user=5), status(0o40755, user=5), 5, "it is write-protected"),
        (status(0o100466, user=5), status(0o40755, user=5), 5, "it is write-protected"),
        (status(0o100644, user=5), status(0o40777, user=7), 6, "it is write-protected"),
        (status(0o100666, user=5), status(0o40777, user=7), 6, ""),
        (status(0o100444, user=5), status(0o40755, user=0), 0, "it is write-protected"),
        (status(0o100600, user=5), status(STICKY, user=0), 0, ""),
        (status(0o100666, user=5), status(STICKY, user=7), 6, "it belongs to somebody else"),
        (status(0o100666, user=5), status(STICKY, user=6), 6, ""),
        (status(0o100444), status(0o40777), None, "it is write-protected"),
        (status(0o100666), status(0o40777), None, ""),
    ],
)
def test_protection_is_judged_by_the_mode_since_root_may_write_everything(file, folder, user, expected):
    assert atomic_file.protection(file, folder, user).startswith(expected)
    assert bool(atomic_file.protection(file, folder, user)) == bool(expected)


@posix
@pytest.mark.parametrize("bits", [stat.S_ISUID, stat.S_ISGID, stat.S_ISVTX])
def test_only_permissions_are_taken_over(tmp_path, bits):
    old = tmp_path / "run.csv"
    old.write_text("old")
    old.chmod(0o775 | bits)
    with sinks.open_sink(old, ("t",)):
        pass
    assert stat.S_IMODE(old.stat().st_mode) == 0o775


@root
def test_root_leaves_a_file_to_its_owner(command, here):
    Path("run.csv").write_text("old")
    os.chown("run.csv", 54321, 54322)
    Path("run.csv").chmod(0o4660)
    assert command("simulate", "m.yaml", "-q", "-o", "run.csv")[2] == 0
    found = Path("run.csv").stat()
    assert (found.st_uid, found.st_gid, stat.S_IMODE(found.st_mode)) == (54321, 54322, 0o660)


@posix
def test_a_group_that_cannot_be_kept_gives_its_permissions_to_no_other(tmp_path, monkeypatch):
    old = tmp_path / "run.csv"
    old.write_text("old")
    old.chmod(0o664)

    def refuse(*arguments):
        raise PermissionError(1, "not yours")

    monkeypatch.setattr(os, "chown", refuse)
    kept = atomic_file._take_over
    foreign = os.stat_result((0o100664, 0, 0, 0, os.getuid(), os.getgid() + 1, 0, 0, 0, 0))
    monkeypatch.setattr(atomic_file, "_take_over", lambda path, _: kept(path, foreign))
    with sinks.open_sink(old, ("t",)):
        pass
    assert stat.S_IMODE(old.stat().st_mode) == 0o644


# Nothing is left behind.


@pytest.mark.parametrize("moment", ["made", "opened", "moved"])
def test_a_file_aside_whose_writer_was_interrupted_is_swept_away(tmp_path, moment, monkeypatch):
    """Between two lines there is no handler: an interrupt may come before the writer knows its file."""
    target = tmp_path / "run.json"
    name, function = {
        "made": ("open", os.open),
        "opened": ("close", os.close),
        "moved": ("chmod", os.chmod),
    }[moment]
    target.write_text("old")

    def interrupted(*arguments, **options):
        function(*arguments, **options)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(os, name, interrupted)
        with pytest.raises(KeyboardInterrupt):
            atomic_file.PendingFile(target).commit()
    atomic_file.sweep()
    assert [path.name for path in tmp_path.iterdir()] == ["run.json"]
    assert target.read_text() == "old"


def test_sweeping_leaves_what_is_finished_and_what_belongs_to_others(tmp_path):
    (tmp_path / ".run.json.00000000.tmp").write_text("of somebody else")
    one, two = atomic_file.PendingFile(tmp_path / "one.json"), atomic_file.PendingFile(tmp_path / "two.json")
    one.commit()
    two.keep_partial()
    atomic_file.sweep()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        ".run.json.00000000.tmp", "one.json", "two.json.partial",
    ]  # fmt: skip
    assert json.dumps(sorted(map(str, atomic_file._begun))) == "[]"


# Several files of one run.


FILES = ("-o", "t.csv", "--events", "e.csv", "--checkpoint", "c.json", "--stats", "s.json")


def full(*arguments, **options):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def ended(tmp_path, files=FILES):
    """Exit code and stderr of a run in a folder with an old table, and the files that it leaves."""
    (tmp_path / "m.yaml").write_text(PENDULUM)
    (tmp_path / "t.csv").write_text("old")
    done = in_process.completed(
        "simulate", "m.yaml", "-q", "--duration", "0.2", "--samples", "5", *files, folder=tmp_path
    )
    return done, sorted(path.name for path in tmp_path.iterdir() if path.name != "m.yaml")


def test_no_table_takes_its_place_where_another_cannot(tmp_path, monkeypatch):
    finish = csv_format.CsvWriter.finish

    def second(self):
        if self._at:
            full()
        finish(self)

    monkeypatch.setattr(csv_format.CsvWriter, "finish", second)
    done, left = ended(tmp_path)
    assert done.returncode == 74
    assert done.stderr == f"lagcli: cannot write e.csv: {os.strerror(errno.ENOSPC)}\n"
    assert (tmp_path / "t.csv").read_text() == "old"
    assert left == ["c.json", "e.csv.rows", "s.json", "t.csv", "t.csv.rows"]  # to go on from


def test_where_the_first_checkpoint_cannot_be_written_nothing_is_left(tmp_path, monkeypatch):
    monkeypatch.setattr(run_tables.CheckpointWriter, "write", full)
    done, left = ended(tmp_path, FILES[:6])
    assert done.returncode == 74
    assert "cannot write c.json" in done.stderr
    assert (left, (tmp_path / "t.csv").read_text()) == (["t.csv"], "old")


def test_where_the_last_checkpoint_cannot_be_written_the_tables_are_named(tmp_path, monkeypatch):
    write = run_tables.CheckpointWriter.write
    monkeypatch.setattr(
        run_tables.CheckpointWriter, "write", lambda self: full() if self.has_written else write(self)
    )
    done, left = ended(tmp_path)
    assert done.returncode == 74
    assert "t.csv and e.csv are complete" in done.stderr
    assert "cannot write c.json" in done.stderr
    assert left == ["c.json", "e.csv", "s.json", "t.csv"]
    account = json.loads((tmp_path / "s.json").read_text())
    assert (account["rows"], account["t_end"]) == (5, 0.2)


def test_where_the_account_cannot_be_written_the_table_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(written_run.atomic_file, "write", full)
    done, left = ended(tmp_path, ("-o", "t.csv", "--stats", "s.json"))
    assert done.returncode == 74
    assert "lagcli: t.csv is complete" in done.stderr
    assert "cannot write s.json" in done.stderr
    assert left == ["t.csv"]


def test_a_file_aside_that_cannot_be_closed_does_not_stay(tmp_path, monkeypatch):
    close = os.close

    def fails(number):
        close(number)
        full()

    with monkeypatch.context() as patch:
        patch.setattr(os, "close", fails)
        with pytest.raises(OSError, match="No space"):
            atomic_file.PendingFile(tmp_path / "t.csv")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("size", "is_told"), [(5e8, False), (2e9, True), (1e11, True)])
def test_the_size_of_a_large_table_is_told_before_it_is_written(tmp_path, monkeypatch, size, is_told):
    (tmp_path / "m.yaml").write_text(PENDULUM)
    monkeypatch.setattr(sinks.Sink, "write", full)
    columns = len(lagcli.simulate(lagcli.loads(PENDULUM)).columns)
    rows = int(size / 8 / columns)
    done = in_process.completed("simulate", "m.yaml", "--samples", rows, "-o", "t.csv", folder=tmp_path)
    told = f"note: {rows} rows of {columns} columns are {8e-9 * rows * columns:.3g} GB of numbers"
    assert (told in done.stderr) is is_told
    assert "cannot write t.csv" in done.stderr
