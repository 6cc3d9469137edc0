"""The explorer of a study: a page on this machine, in a frame of a notebook."""

import json
import urllib.error
import urllib.request

import pytest

import stickslip


def ask(address, **headers):
    with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=30) as answer:
        return answer.headers, answer.read().decode()


def test_a_study_opens_with_its_values():
    study = stickslip.Study.from_template("blade-couple").set(kt="12 N/mm", Ft="5 N")
    explorer = study.explore()
    try:
        origin, token = explorer.address.split("/?token=")
        headers, page = ask(explorer.address)
        assert "<main" in page
        # a notebook on this machine may show it in a frame
        assert "frame-ancestors http://localhost:*" in headers["content-security-policy"]
        assert explorer.address in explorer._repr_html_() and "<iframe" in explorer._repr_html_()
        first = json.loads(ask(f"{origin}/api/catalog", **{"x-stickslip-token": token})[1])["first"]
        body = json.dumps({"study": first, "changes": []}).encode()
        request = urllib.request.Request(
            f"{origin}/api/describe", data=body, headers={"x-stickslip-token": token, "origin": origin}
        )
        with urllib.request.urlopen(request, timeout=30) as answer:
            described = json.loads(answer.read())
        values = {one["name"]: one["text"] for one in described["quantities"] if one["group"] == "parameters"}
        assert (values["kt"], values["Ft"], len(described["cases"])) == ("12 N/mm", "5 N", 1)
    finally:
        explorer.stop()
    with pytest.raises(urllib.error.URLError):
        ask(explorer.address)
    explorer.stop()


def test_a_method_by_a_call_is_refused():
    with pytest.raises(stickslip.StudyError, match=r"write it into \[method\]"):
        stickslip.Study.from_template("blade-couple").method("shooting").explore()


def test_a_taken_port_is_an_error():
    study = stickslip.Study.from_template("element")
    explorer = study.explore()
    port = int(explorer.address.split(":")[2].split("/")[0])
    with pytest.raises(OSError, match=str(port)):
        study.explore(port=port)
    explorer.stop()
