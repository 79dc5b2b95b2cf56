"""A run ends with half a page on each data set; the paper's claims are of its own arm alone."""


def test_a_run_ends_with_what_the_calibrations_are_worth(project):
    for name in ("mh180", "own"):
        (project.folder / "results" / name / "summary.parquet").unlink()
    text = project.snakemake()
    paper = text[text.index("mh180: the paper reproduced") :]
    claims = paper.split("figures  ")[0]
    for word in ("agree", "differ", "cannot be compared", "results/mh180/claims.parquet"):
        assert word in claims
    assert "results/mh180/figures: fig1 to fig6" in paper
    for name in ("mh180", "own"):
        page = paper[paper.index(f"{name}: what its calibration is worth") :]
        for word in ("held-out error", "selected", "valid where", "undetermined", "not assessed"):
            assert word in page
        assert f"kinacc compensate results/{name} --pose " in page
    page = paper[: paper.index("own: what")]
    for word in ("model difference: at most", "map error: at most", "operating-point error: at"):
        assert page.count(word) >= 1
    assert "own: the paper" not in text


def test_a_run_up_to_one_table_says_nothing_of_tables_it_did_not_ask_for(project):
    (project.folder / "results/own/vec_model.parquet").unlink()
    text = project.snakemake("results/own/vec_model.parquet")
    assert "what its calibration is worth" not in text
