"""Files of weights name the method that they belong to; they come from anyone, so a name never makes code run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dextron_bench.errors import BadInput
from dextron_bench.methods import weights
from dextron_bench.storage import tensors


@pytest.mark.parametrize("form", ["{here}/stolen.py:Stolen", "stolen:Stolen", 7, ["rlil"], "policy.pt", "exec:ls"])
def test_metadata_names_installed_methods_only_and_imports_nothing(
    form: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The module that the metadata names would write a file when it is imported."""
    (tmp_path / "stolen.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w').close()\nclass Stolen: name = 's'\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    method = form.format(here=tmp_path) if isinstance(form, str) else form
    file = tmp_path / "weights.safetensors"
    tensors.write(file, {"a": np.zeros(1)}, {"method": method, "settings": {}})
    with pytest.raises(BadInput, match="which is not installed"):
        weights.load_agent_from_file(file)
    assert not (tmp_path / "ran").exists()


def test_settings_that_are_not_settings_are_refused(tmp_path: Path):
    file = tmp_path / "weights.safetensors"
    tensors.write(file, {"a": np.zeros(1)}, {"method": "rl", "settings": ["preset"]})
    with pytest.raises(BadInput, match="which method"):
        weights.load_agent_from_file(file)
