"""Names of campaigns say their condition, and differ if the conditions do."""

from mutator.paper.uva_campaigns import campaign_name


def test_a_name_says_when() -> None:
    assert campaign_name("hwt >= 0 and hwt <= 1.5", (), ()) == "uva_hwt_from_0_and_hwt_to_1_5"
    assert campaign_name("", ("pictures", "reference_plant"), ()) == "uva_always_pictures"


def test_a_sign_is_in_the_name() -> None:
    assert campaign_name("t < -0.01", (), ()) == "uva_t_before_minus_0_01"


def test_a_taken_name_gets_a_digest_of_condition_and_setting() -> None:
    """One campaign never replaces another, of the import or of the shipped library."""
    taken = ("uva_t_before_1", "uva_t_before_1_pictures")
    names = {campaign_name("t < 1", setting, taken) for setting in ((), ("pictures",))}
    assert len(names) == 2 and not names & {*taken}
    assert all(name.startswith("uva_t_before_1_") for name in names)


def test_a_long_name_is_cut_and_stays_different() -> None:
    """Names of files have at most 255 bytes."""
    whens = [" and ".join([f"hwt <= {n}"] * 40) + f" and t > {n}" for n in (7, 8)]
    first, second = (campaign_name(when, (), ()) for when in whens)
    assert first != second and len(first) <= 100 >= len(second)
