"""The commands of `counterlight` that talk to the daemon."""
import json
import os
import subprocess

from exhibit import PATIENCE, exhibit, main

PROGRAM = os.environ["CLT_PROGRAM"]


def counterlight(run, *words, environment=None):
    done = subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, timeout=PATIENCE,
                          env={**os.environ, "COUNTERLIGHT_SOCKET": str(run.socket), **(environment or {})})
    return done.returncode, done.stdout, done.stderr


def good(run, *words):
    code, out, said = counterlight(run, *words)
    assert code == 0 and said == "", (words, code, said)
    return out


def commands_do_what_they_say():
    with exhibit() as run:
        run.start()
        run.client().close()
        out = good(run, "watch", "--until", "showing")
        assert out.strip().split("\n")[-1].startswith("showing since 20"), out
        text = good(run, "status")
        for wanted in ("showing since", "transport  16 x 12 cells, 3 channels", "% error by", "cost", "devices"):
            assert wanted in text, text
        status = json.loads(good(run, "status", "--json"))
        assert status["state"] == "showing" and status["transport"]["patterns"] > 0
        assert good(run, "status", "-q") == ""
        assert "holding" in good(run, "hold")
        assert "asked to hold" in good(run, "status")
        good(run, "resume")
        good(run, "watch", "--until", "showing", "-q")
        for line in good(run, "snapshot").strip().split("\n"):
            assert os.path.exists(line.split()[1]), line
        assert set(json.loads(good(run, "snapshot", "--json"))) == {"target", "drive", "observation"}
        assert f"{run.config} read again" in good(run, "reload")


def show_passes_the_opened_file():
    with exhibit() as run:
        run.start()
        run.wait_state("showing")
        assert str(run.content) in good(run, "show", run.content)
        link = run.folder / "a picture with spaces.png"
        link.symlink_to(run.content)
        assert json.loads(good(run, "show", "--json", link))["content"] == str(run.content)
        text = run.folder / "text.png"
        text.write_text("none")
        code, out, said = counterlight(run, "show", text)
        assert code == 2 and out == "" and "is no picture" in said, said
        code, _, said = counterlight(run, "show", "/no/such.png")
        assert code == 2 and "/no/such.png: cannot be read" in said, said
        assert counterlight(run, "show")[0] == 2
        assert run.wait_state("showing")["content"] == str(run.content)


def reacquire_waits_and_fails_where_it_failed():
    with exhibit() as run:
        run.start()
        first = run.wait_state("showing")
        assert "acquiring" in good(run, "reacquire")
        run.wait_state("showing")
        lines = good(run, "reacquire", "--wait").strip().split("\n")
        assert lines[0].startswith("acquiring since") and lines[-1].startswith("showing since"), lines
        assert any("patterns" in line for line in lines), lines
        for line in good(run, "reacquire", "--wait", "--json").strip().split("\n"):
            assert json.loads(line)["method"] in ("state", "progress")
        assert run.status()["transport"]["grid"] == first["transport"]["grid"]
        code, _, said = counterlight(run, "reacquire", "--scope", "geometry")
        assert code == 1 and "counterlight calibrate" in said
        lines = good(run, "reacquire", "--scope", "changed", "--wait").strip().split("\n")
        assert any(line.startswith("reacquired nothing changed, by 10 patterns") for line in lines), lines
        assert "reacquired nothing changed" in good(run, "status")
        code, _, said = counterlight(run, "reacquire", "--scope", "all")
        assert code == 2 and "scope" in said
        run.stop()
        run.write_config(station="rig = { timeout_ms = 1; attempts = 1; };")
        run.start()
        run.wait_state("showing")
        code, _, said = counterlight(run, "reacquire", "--wait")
        assert code == 1 and "holding" in said and "the earlier picture stays up" in said, said


def without_a_daemon_it_says_what_to_do():
    with exhibit() as run:
        for words in (("status",), ("watch",), ("reacquire", "--wait"), ("hold",), ("show", run.content)):
            code, out, said = counterlight(run, *words)
            assert code == 1 and out == "", (words, code)
            assert "no daemon answers at" in said and "start counterlightd" in said and said.count("\n") == 1, said
        code, _, said = counterlight(run, "status", "--socket", "x" * 200)
        assert code == 2 and "at most 107" in said, said
        run.start()
        run.wait_state("showing")
        watcher = subprocess.Popen([PROGRAM, "watch", "--until", "stopping"], stdout=subprocess.PIPE, text=True,
                                   env={**os.environ, "COUNTERLIGHT_SOCKET": str(run.socket)})
        assert watcher.stdout.readline().startswith("showing"), "the state that is comes first"
        run.stop()
        out, _ = watcher.communicate(timeout=PATIENCE)
        assert watcher.returncode == 0 and "stopping" in out, out


def own_places_are_found():
    with exhibit() as run:
        folder = run.folder / "counterlight"
        folder.mkdir()
        run.socket = folder / "control.sock"
        run.start()
        run.wait_state("showing")
        environment = {"COUNTERLIGHT_SOCKET": "", "RUNTIME_DIRECTORY": str(folder)}
        code, out, said = counterlight(run, "status", environment=environment)
        assert code == 0 and out.startswith("showing"), said


if __name__ == "__main__":
    main([commands_do_what_they_say, show_passes_the_opened_file, reacquire_waits_and_fails_where_it_failed,
          without_a_daemon_it_says_what_to_do, own_places_are_found])
