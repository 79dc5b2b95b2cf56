"""A run ends with half a page on each data set; claims of the paper are of its arm alone."""


def test_a_run_ends_with_what_the_calibrations_are_worth(project):
    summaries = [f"results/{name}/summary.parquet" for name in ("mh180", "own")]
    for path in summaries:
        (project.folder / path).unlink()
    text = project.snakemake(*summaries)
    paper, own = text[text.index("\nmh180: ") :], text[text.index("\nown (") :]
    assert "Paper's claims" in paper
    assert "Paper's claims" not in own
    for name, page in (("mh180", paper), ("own", own)):
        assert "Mean position error at" in page
        assert f"kinacc compensate results/{name} --program " in page
