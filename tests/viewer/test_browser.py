"""The page in a browser: it plays, nothing is reported on the console, and a frame takes little script."""

import shutil

import numpy as np
import pytest

import tsdyn as ts
from examples import four_bar

pytestmark = pytest.mark.slow
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
WAIT = 60_000  # ms


@pytest.fixture(scope="module")
def browser():
    play = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install 'tsdyn[test]'")
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    with play.sync_playwright() as playwright:
        try:
            browser = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        except play.Error as error:
            pytest.skip(f"no Chromium could be started: {error.message.splitlines()[0]}")
        yield browser
        browser.close()


@pytest.fixture
def opened(browser, tmp_path):
    """A page of a run, offline, and what it reports."""
    context = browser.new_context(viewport={"width": 640, "height": 480}, offline=True)
    reports = []

    def open_page(solution, **options):
        page = context.new_page()
        page.on("console", lambda message: reports.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: reports.append(str(error)))
        page.goto(solution.view(tmp_path / "run", **options).as_uri())
        page.wait_for_function("window.tsdyn && tsdyn.milliseconds() > 0", timeout=WAIT)
        return page, reports

    yield open_page
    context.close()


def picture(page):
    """The canvas, drawn now, as a PNG in base64."""
    return page.evaluate("(draw(), canvas.toDataURL())")


def clock(page):
    return float(page.text_content("#clock").split()[0])


def test_a_page_plays_by_itself_and_loops(opened):
    page, reports = opened(ts.simulate(four_bar.build(), (0.0, 0.5)))
    first = picture(page)
    page.wait_for_function(f"parseFloat(document.getElementById('clock').textContent) != {clock(page)}", timeout=WAIT)
    assert picture(page) != first
    page.evaluate("document.getElementById('speed').value = document.getElementById('speed').options[7].value")
    page.wait_for_function(
        "(window.last ??= 0, window.back = window.back || frame < last, window.last = frame, window.back)", timeout=WAIT
    )
    assert reports == []


def test_controls_do_what_they_say(opened):
    scene = four_bar.build()
    crank = scene.bodies[0]
    page, reports = opened(ts.simulate(scene, (0.0, 1.0)), shapes={crank: ts.shapes.Box((0.4, 0.1, 0.1))})
    page.click("#play")
    page.evaluate("tsdyn.seek(0.25)")
    page.wait_for_function("document.getElementById('clock').textContent.startsWith('0.250')", timeout=WAIT)
    before = picture(page)
    for name in ("reactions", "frames", "joints", "trails", "grid"):
        page.click(f"#show-{name}")
        after = picture(page)
        assert after != before, name
        before = after
    page.select_option("#follow", label=crank.name)
    assert picture(page) != before
    assert reports == []


def test_a_trail_goes_through_its_point(opened):
    scene = four_bar.build()
    solution = ts.simulate(scene, (0.0, 1.0))
    page, reports = opened(solution, trails=[("crank", (0.15, 0, 0))])
    way = page.evaluate("[...trails.children[0].geometry.getAttribute('position').array]")
    end = np.reshape(way, (-1, 3))[-1] + page.evaluate("run.origin")
    np.testing.assert_allclose(end, solution.position("crank", point=(0.15, 0, 0))[-1], atol=1e-4)
    assert reports == []


def test_a_contact_changes_its_colour(opened):
    scene = ts.Scene(gravity=(0, 0, -10))
    bead = scene.add_point_mass(mass=1.0, position=(2, 0, 0))
    scene.add(ts.constraints.PlaneContact(bead, scene.ground, normal_b=(0, 0, 1)))
    scene.add(ts.forces.Spring(bead, scene.ground, point_b=(0, 0, 1), stiffness=20.0, free_length=0.6))
    solution = ts.simulate(scene, (0.0, 3.0))
    middle = float(solution.t[np.abs(solution.position(bead)[:, 0]).argmin()])
    page, reports = opened(solution)
    colours = []
    for time in (0.0, middle):
        page.evaluate(f"(tsdyn.seek({time}), draw())")
        (contact,) = page.evaluate(
            "contacts.map(({ mesh, place }) => [...mesh.instanceColor.array.slice(3 * place / 16, 3 * place / 16 + 3)])"
        )
        colours.append(contact)
    (red, green), (red_later, green_later) = (colour[:2] for colour in colours)
    assert red > green
    assert green_later > red_later
    assert "contacts: green pushes" in page.text_content("#legend")
    assert reports == []


def test_a_frame_of_fifty_bodies_takes_little_script(opened):
    """Instances of few meshes: as many draw calls as for two bodies."""
    from tests.helpers.hanging_chains import pendulums

    calls = []
    for count in (2, 50):
        page, reports = opened(ts.simulate(pendulums([0.3] * count), (0.0, 0.05)))
        calls.append(page.evaluate("renderer.info.render.calls - trailOf.size"))
        assert reports == []
    assert calls[0] == calls[1]
