"""kinacc is installed from a wheel, and used in a folder that holds nothing."""


def test_the_papers_study_runs_from_the_installed_package(shell, tmp_path):
    folder = tmp_path / "my cell"
    folder.mkdir()
    code, printed, _ = shell('python -c "import kinacc; print(kinacc.__file__)"', folder)
    assert (code, printed.strip()) == (0, str(shell.installed / "kinacc" / "__init__.py"))
    code, printed, _ = shell("kinacc calibrate", folder)
    assert code == 2
    assert "kinacc init" in printed
    code, printed, _ = shell("kinacc study -- --dry-run", folder)
    assert code == 0, printed
    assert "study_part" in printed
