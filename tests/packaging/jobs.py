"""What each extra is for, as a small job: run with an installed package, from an empty folder.

`python -P jobs.py NAME`; the names are those of the extras, and `library` for what comes without any.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

TINY = ("demonstrations=2", "starts=2", "other_starts=2", "seconds=5", "vsa.dim=300", "workers=1", "animate=false")


def torchvsa(*arguments: str) -> str:
    """What the installed command prints; it must succeed."""
    command = shutil.which("torchvsa", path=str(Path(sys.executable).parent))
    assert command is not None
    done = subprocess.run([command, *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"torchvsa {' '.join(arguments)} failed:\n{done.stdout}{done.stderr}")
    return done.stdout


def library() -> None:
    """The algebra, a bank in a file, and no other package."""
    import torch

    import behaviours as bh
    import torchvsa

    loaded = {name.split(".")[0] for name in sys.modules}
    assert not loaded & {"pandas", "sklearn", "hydra", "matplotlib", "pybullet", "gymnasium", "rerun"}
    generator = torch.Generator().manual_seed(0)
    for name in torchvsa.ARCHITECTURES:
        vsa = torchvsa.architecture_near(name, 1000)
        a, b = vsa.random(2, generator=generator)
        assert vsa.similarity(vsa.unbind(vsa.bind(a, b), b), a) > 0.3, name
    schema = bh.Schema([bh.Sensor("left", 0, 1), bh.Sensor("right", 0, 1)], [bh.Actuator("turn", -1, 1, levels=3)])
    readings = torch.rand(300, 2, generator=generator)
    commands = torch.sign(readings[:, :1] - readings[:, 1:])
    bank = bh.BehaviourBank(bh.Space(schema))
    bank.learn("steer", bh.Demonstrations(readings, commands))
    bank.save("robot.safetensors")
    again = bh.BehaviourBank.load("robot.safetensors")["steer"](readings)
    assert (again.commands == commands).double().mean() > 0.9
    assert torch.equal(again.commands, bank["steer"](readings).commands)


def without_studies() -> None:
    """Without the extra the command says in one line what to install."""
    command = [str(Path(sys.executable).with_name("torchvsa")), "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.endswith("pip install 'torchvsa[corral]'"), line


def sklearn() -> None:
    """The estimators on the data that come with the package."""
    from behaviours import BehaviourClassifier
    from behaviours.data import load_wall_following

    readings, commands = load_wall_following(sensors=2)
    model = BehaviourClassifier(dim=500, epochs=5, random_state=0).fit(readings[:1000], commands[:1000])
    assert model.score(readings[1000:1500], commands[1000:1500]) > 0.5


def vector() -> None:
    """The world in the fast engine, and as a Gymnasium environment."""
    import gymnasium

    import sim

    rollout = sim.rollout(sim.Teacher(), episodes=range(10))
    assert rollout.success.all()
    env = gymnasium.make("CorralEscape-v0")
    env.reset(seed=0)
    assert len(env.step([1.0, 1.0])) == 5


def sim() -> None:
    """The world in both engines, and a picture."""
    import sim

    vector()
    rollouts = [sim.rollout(sim.Teacher(), episodes=[0], seconds=10, engine=engine) for engine in sim.ENGINES]
    from sim import render

    render.animate(rollouts, list(sim.ENGINES), Path("drive.gif"), 0)
    assert Path("drive.gif").stat().st_size > 1000


def studies() -> None:
    """The command, a study without a robot, and the corral in the fast engine."""
    assert "capacity" in torchvsa("--help")
    torchvsa("capacity", "experiment=quick", "workers=1")
    torchvsa("corral", "controllers=[teacher,default,bundled]", *TINY)
    assert len(list(Path("outputs").rglob("report.html"))) == 2


def corral() -> None:
    """The main job, all rows."""
    assert "table" in torchvsa("corral", "--help")
    torchvsa("corral", "experiment=quick")
    (page,) = Path("outputs/corral").rglob("report.html")
    assert "default_bullet" in page.read_text()


def rl() -> None:
    """The row that learns by reward."""
    torchvsa("corral", "controllers=[teacher,ppo]", "ppo_steps=2000", *TINY)


def control() -> None:
    """A task of Gymnasium's, and Box2D."""
    import gymnasium

    gymnasium.make("LunarLander-v3").reset(seed=0)
    assert "LunarLander" in torchvsa("cloning", "--help")


def cluster() -> None:
    """A sweep whose jobs are processes of their own, the launcher for Slurm, and what Dask and Optuna need."""
    import distributed  # noqa: F401 (found)
    import optuna  # noqa: F401

    torchvsa("capacity", "--multirun", "experiment=quick", "workers=1", "seed=0,1", "hydra/launcher=submitit_local")
    assert len(list(Path("outputs").rglob("results.json"))) == 2
    assert "submitit_slurm" in torchvsa("corral", "hydra/launcher=submitit_slurm", "--cfg", "hydra")


def rerun() -> None:
    """A file for Rerun, which its own reader reads."""
    from rerun.chunk import RrdReader

    torchvsa("corral", "controllers=[teacher,default]", *TINY)
    (results,) = Path("outputs").rglob("results.json")
    torchvsa("rrd", str(results.parent), "0")
    chunks = RrdReader(results.parent / "rrd" / "start_0.rrd").stream().to_chunks()
    assert "/familiarity/default" in {chunk.entity_path for chunk in chunks}


def data() -> None:
    """A table, an environment of Gymnasium's, a data set of Minari's and a recording of ROS 2."""
    import gymnasium
    from mcap_ros2.writer import Writer
    from pyarrow import parquet, table

    import behaviours as bh
    from behaviours.data import collect, read, write_minari

    parquet.write_table(table({"front": [0.1, 0.9], "v": [0, 1]}), "log.parquet")
    assert bh.Schema.from_data(read("log.parquet"), ["v"]).actuators[0].levels == 2
    env = gymnasium.make("CartPole-v1")
    log = collect(env, lambda seen: int(seen[2] > 0), episodes=2)
    schema = bh.Schema.from_env(env, log)
    os.environ["MINARI_DATASETS_PATH"] = "sets"
    write_minari(bh.Demonstrations.from_data(log, schema), schema, "own/cart-v0")
    assert len(read("sets/own/cart-v0")) == len(log)
    with open("run.mcap", "wb") as file, Writer(file) as writer:
        kind = writer.register_msgdef("std_msgs/msg/Float64", "float64 data")
        for topic, value in (("/front", 1.0), ("/speed", 2.0), ("/speed", 3.0)):
            writer.write_message(topic, kind, {"data": value}, log_time=len(topic) + int(value))
    assert len(bh.data.read_mcap("run.mcap", commands="/speed")) == 2


def onnx() -> None:
    """A behaviour as an ONNX file, which the runtime answers from."""
    import numpy as np
    import onnxruntime
    import torch

    import behaviours as bh
    from behaviours.onnx import to_onnx

    schema = bh.Schema([bh.Sensor("left", 0, 1)], [bh.Actuator("turn", -1, 1, levels=3)])
    bank = bh.BehaviourBank(bh.Space(schema))
    bank.learn("steer", bh.Demonstrations([[0.1], [0.9]], [[-1], [1]]))
    to_onnx(bank["steer"], "steer.onnx")
    session = onnxruntime.InferenceSession("steer.onnx")
    asked = np.array([[0.1], [0.9]])
    commands = np.asarray(session.run(None, {"readings": asked})[0])
    assert np.array_equal(commands, bank["steer"](torch.from_numpy(asked)).commands.numpy())


def docs() -> None:
    """The builder of the site and its theme."""
    import furo  # noqa: F401 (found)
    import myst_parser  # noqa: F401
    import sphinx  # noqa: F401
    import sphinx_design  # noqa: F401


JOBS: dict[str, Callable[[], None]] = {
    job.__name__: job
    for job in (
        library, without_studies, sklearn, vector, sim, studies, corral, rl, control, cluster, data, rerun, onnx, docs
    )
}  # fmt: skip

if __name__ == "__main__":
    for name in sys.argv[1:]:
        JOBS[name]()
