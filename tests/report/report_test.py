"""Tests the report of a small run in a headless Chromium: it opens without errors, its views of maps and
scenes rotate, locations can be selected in the table and in the view, it fits a phone's screen, and its
text is readable without JavaScript.

    report_test.py GRASPMAP SOURCE_FOLDER

Exits with 77 if Chromium, chromedriver or three.js are not installed."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

from webdriver import Browser

ATTACK = '<img src=x onerror=hacked()>'
FIGURE = 'document.querySelector("figure.map")'
SCENE = 'document.querySelectorAll("figure.map")[1]'
FLOOR = 'OFF\n4 2 0\n-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n3 0 1 2\n3 0 2 3\n'


def check(condition, what):
    if not condition:
        raise AssertionError(what)


def wait_for(what, condition):
    end = time.monotonic() + 60
    while not condition():
        check(time.monotonic() < end, f'waited in vain: {what}')
        time.sleep(0.05)


def make_run(graspmap, folder):
    run = folder / 'run'
    run.mkdir()

    def call(*words):
        subprocess.run([graspmap, *map(str, words), '--quiet'], check=True)

    (folder / 'points.csv').write_text(
        'place,x,y,z,graspable\n'
        f'{ATTACK},0.5,-1,0.10,1\nH25,-1,-1,0.25,0\nG,0.25,-0.5,0,\n')
    (run / 'wide.csv').write_text(
        ','.join(f'column_{n}' for n in range(30)) + '\n' + ','.join(['0.123456'] * 30) + '\n')
    call('simulate', 'scene', '--spacing', '0.02', '-o', folder / 'terrain.pcd')
    call('score', folder / 'terrain.pcd', '--config', 'primitive_shapes_prescan', '--voxel-size',
         '0.02', '-o', run / 'map.pcd')
    call('lookup', run / 'map.pcd', folder / 'points.csv', '-o', run / 'lookup.csv')
    (folder / 'floor.off').write_text(FLOOR)
    (folder / 'places.csv').write_text('x,y,z\n0,0,0\n')
    call('grasp', folder / 'floor.off', '--points', folder / 'places.csv', '--trials', '1',
         '--draws', '1', '--scenes', run / 'scenes', '-o', folder / 'trials.csv')
    # An arbitrary image.
    shutil.copy(pathlib.Path(sys.argv[2]) / 'pipelines/primitive_shapes.png', run / 'top.png')
    (run / f'{ATTACK}.txt').write_text(f'The first words. {ATTACK}')
    (run / 'broken.png').write_text('no picture')
    call('report', run, '--title', f'A study {ATTACK}', '-o', folder / 'report.html',
         '--max-cells', 3000)
    return folder / 'report.html'


class Page:
    def __init__(self, browser, report):
        self.browser = browser
        browser.open(report)

    def show_view(self, figure=FIGURE):
        self.browser.run(f'{figure}.scrollIntoView()')
        wait_for('the view is drawn', lambda: self.drawn(figure) > 0)
        self.settle(figure)

    def drawn(self, figure=FIGURE):
        return int(self.browser.run(f'return {figure}.dataset.drawn || "0"'))

    def settle(self, figure=FIGURE):
        """Waits until all requested images are drawn."""
        wait_for('the view is at rest',
                 lambda: self.browser.run(f'return {figure}.dataset.busy === undefined'))

    def picture(self, figure=FIGURE):
        return self.browser.run(f'return {figure}.querySelector("canvas").toDataURL()')

    def colors(self, figure):
        """Returns the share of the canvas's pixels of each kind."""
        return self.browser.run(f'''
            const canvas = {figure}.querySelector("canvas");
            const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
            const count = {{drawn: 0, green: 0, blue: 0}};
            for (let n = 0; n < data.length; n += 4) {{
              const [r, g, b, a] = data.subarray(n, n + 4);
              if (a > 128) count.drawn++;
              if (a > 128 && g > 1.5 * r && g > 1.5 * b) count.green++;
              if (a > 128 && b > 1.5 * r) count.blue++;
            }}
            for (const kind in count) count[kind] /= data.length / 4;
            return count;''')

    def middle(self):
        box = self.browser.run(
            'const b = document.querySelector("figure.map canvas").getBoundingClientRect();'
            'return [b.left + b.width / 2, b.top + b.height / 2]')
        return box

    def selected(self):
        return self.browser.run(f'return {FIGURE}.dataset.selected || null')

    def selected_row(self):
        return self.browser.run(
            'const row = document.querySelector("figure.map tr.selected");'
            'return row && row.querySelector("th").textContent')

    def check_no_errors(self):
        messages = [one['message'] for one in self.browser.console()]
        check(not messages, f'the console says: {messages}')
        check(self.browser.run('return document.querySelectorAll("[onerror]").length') == 0,
              'data were interpreted as HTML')
        check(self.browser.run('return performance.getEntriesByType("resource")'
                               '.filter(e => !e.name.startsWith("data:")).length') == 0,
              'the page loaded a resource')


def on_a_desktop(report):
    with Browser(1280, 900) as browser:
        page = Page(browser, report)
        check('<img' in browser.text('h1'), 'the title is not escaped')
        page.show_view()
        first = page.picture()

        browser.drag(page.middle(), (120, 40))
        page.settle()
        turned = page.picture()
        check(turned != first, 'rotating the map did not change the image')

        # A location selected in the table moves to the center of the view.
        browser.run('document.querySelector("figure.map tr[data-place=\\"1\\"] button").click()')
        wait_for('the row is chosen', lambda: page.selected() == 'H25')
        page.settle()
        check(page.selected_row() == 'H25', 'the row is not marked')
        chosen = page.picture()
        check(chosen != turned, 'selecting a location did not change the image')

        # A click on the center of the view selects the location there.
        browser.run('document.querySelector("figure.map tr[data-place=\\"0\\"] button").click()')
        wait_for('the other row is chosen', lambda: page.selected() == ATTACK)
        page.settle()
        browser.run('document.querySelector("figure.map tr[data-place=\\"1\\"] button").click()')
        page.settle()
        browser.run(f'{FIGURE}.dataset.selected = ""')
        browser.drag(page.middle(), (0, 0))
        wait_for('the click finds the place', lambda: page.selected() == 'H25')

        for mode in ('convex', 'score'):
            before = page.picture()
            browser.run(f'{FIGURE}.querySelector("button[data-mode={mode}]").click()')
            page.settle()
            check(page.picture() != before, f'{mode} shows the same picture')
            check(browser.run(f'return {FIGURE}.querySelector(".legend[data-mode={mode}]").hidden')
                  is False, f'the legend of {mode} is not shown')
        # Forces: as a color and at the pointer, and the probability for another load.
        for mode in ('force', 'score'):
            before = page.picture()
            browser.run(f'{FIGURE}.querySelector("button[data-mode={mode}]").click()')
            page.settle()
            check(page.picture() != before, f'{mode} shows the same picture')
        at = page.middle()
        browser.drag(at, (0, 0))
        page.settle()
        reading = browser.run(f'return {FIGURE}.querySelector(".reading").textContent')
        check('probability to hold 5 N' in reading, f'at the pointer: {reading}')
        before = page.picture()
        browser.run(f'const slider = {FIGURE}.querySelector("input"); slider.value = "-40";'
                    'slider.dispatchEvent(new Event("input"))')
        page.settle()
        check(page.picture() != before, 'another load shows the same picture')
        check(browser.run(f'return {FIGURE}.querySelector(".legend output").textContent') == '0.5 N',
              'the legend has another load')
        before = page.picture()
        browser.run('document.querySelector("figure.map canvas").dispatchEvent('
                    'new KeyboardEvent("keydown", {key: "ArrowLeft"}))')
        page.settle()
        check(page.picture() != before, 'the arrow key did not turn the map')

        # Floor, green spheres at the contacts, and the gripper in blue.
        page.show_view(SCENE)
        colors = page.colors(SCENE)
        check(0.05 < colors['drawn'] < 0.95, f'the scene covers {colors}')
        check(0.0005 < colors['green'] < 0.05, f'green in the scene: {colors}')
        check(0.005 < colors['blue'] < 0.3, f'blue in the scene: {colors}')
        oblique = page.picture(SCENE)
        browser.run(f'{SCENE}.querySelector("[data-camera=top]").click()')
        page.settle(SCENE)
        check(page.picture(SCENE) != oblique, 'the scene is not seen from the top')

        browser.run('document.querySelector(".picture img").click()')
        check(browser.run('return document.querySelector("dialog").open'), 'no large picture')
        page.check_no_errors()


def on_a_phone(report):
    with Browser(700, 800) as browser:
        browser.resize(360, 740)
        page = Page(browser, report)
        page.show_view()
        width = browser.run('return [document.scrollingElement.scrollWidth, innerWidth]')
        check(width[0] <= width[1], f'the page is {width[0]} wide in a window of {width[1]}')
        page.check_no_errors()


def without_javascript(report):
    off = {'profile.managed_default_content_settings.javascript': 2}
    with Browser(1280, 900, preferences=off) as browser:
        browser.open(report)
        text = browser.text('body')
        for words in ('The first words.', 'H25', 'broken.png cannot be shown', 'voxel matching',
                      'needs JavaScript'):
            check(words in text, f'not readable without JavaScript: {words}')
        for button in ('Oblique', 'Drag to turn'):
            check(button not in text, f'shown without JavaScript: {button}')


def without_webgl(report):
    with Browser(1280, 900, arguments=['--disable-3d-apis']) as browser:
        browser.open(report)
        check('needs WebGL' in browser.text('figure.map'), 'no word on WebGL')


def main():
    if not (shutil.which('chromedriver') and shutil.which('chromium')
            and os.path.exists('/usr/share/javascript/three/three.min.js')):
        print('skipped: chromium, chromium-driver or libjs-three is not installed')
        return 77
    with tempfile.TemporaryDirectory() as folder:
        report = make_run(sys.argv[1], pathlib.Path(folder))
        for part in (on_a_desktop, on_a_phone, without_javascript, without_webgl):
            begin = time.monotonic()
            part(report)
            print(f'{part.__name__}: passed in {time.monotonic() - begin:.1f} s')
    return 0


if __name__ == '__main__':
    sys.exit(main())
