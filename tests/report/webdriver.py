"""Client of the W3C WebDriver protocol (https://www.w3.org/TR/webdriver2) for a headless Chromium, with
chromedriver and the standard library only."""

import base64
import json
import os
import re
import shutil
import subprocess
import tempfile
import urllib.error
import urllib.request

ELEMENT = 'element-6066-11e4-a52e-4f735466cecf'


class Browser:
    """Browser session. `preferences` are those of a Chromium profile."""

    def __init__(self, width=1280, height=900, preferences=None, arguments=()):
        self.folder = tempfile.mkdtemp()
        environment = dict(os.environ, HOME=self.folder)
        self.driver = subprocess.Popen(
            ['chromedriver', '--port=0'], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            env=environment, text=True)
        self.address = f'http://127.0.0.1:{self._port()}'
        self.session = None
        options = {
            'args': ['--headless', '--no-sandbox', '--disable-dev-shm-usage', '--hide-scrollbars',
                     '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
                     f'--user-data-dir={self.folder}/profile', f'--window-size={width},{height}',
                     '--force-device-scale-factor=1', '--disable-background-networking',
                     *arguments],
            'prefs': preferences or {},
        }
        answer = self._send('POST', '/session', {'capabilities': {'alwaysMatch': {
            'browserName': 'chrome', 'timeouts': {'script': 120000}, 'goog:chromeOptions': options,
            'goog:loggingPrefs': {'browser': 'ALL'}}}})
        self.session = answer['sessionId']

    def _port(self):
        for line in self.driver.stdout:
            found = re.search(r'started successfully on port (\d+)', line)
            if found:
                return found.group(1)
        raise RuntimeError('chromedriver did not start')

    def _send(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.address + path, data, method=method,
                                         headers={'Content-Type': 'application/json'})
        try:
            with urllib.request.urlopen(request, timeout=120) as response:
                return json.load(response)['value']
        except urllib.error.HTTPError as error:
            raise RuntimeError(json.load(error)['value']['message']) from None

    def command(self, method, path, body=None):
        return self._send(method, f'/session/{self.session}{path}', body)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        try:
            if self.session:
                self.command('DELETE', '')
        finally:
            self.driver.terminate()
            self.driver.wait()
            self.driver.stdout.close()
            shutil.rmtree(self.folder, ignore_errors=True)

    def open(self, path):
        self.command('POST', '/url', {'url': 'file://' + os.path.abspath(path)})

    def run(self, script, *arguments):
        """Runs `script` as the body of a function and returns its result."""
        return self.command('POST', '/execute/sync', {'script': script, 'args': list(arguments)})

    def find(self, selector):
        return self.command('POST', '/element', {'using': 'css selector', 'value': selector})[ELEMENT]

    def text(self, selector):
        return self.command('GET', f'/element/{self.find(selector)}/text')

    def screenshot(self, selector=None):
        """Returns a PNG image of an element or of the window."""
        place = f'/element/{self.find(selector)}' if selector else ''
        return base64.b64decode(self.command('GET', f'{place}/screenshot'))

    def console(self):
        return self.command('POST', '/se/log', {'type': 'browser'})

    def resize(self, width, height):
        self.devtools('Emulation.setDeviceMetricsOverride',
                      {'width': width, 'height': height, 'deviceScaleFactor': 1,
                       'mobile': width < 600})

    def devtools(self, name, parameters):
        return self.command('POST', '/goog/cdp/execute', {'cmd': name, 'params': parameters})

    def drag(self, start, by):
        """Drags with the left button from a point of the window by (x, y) pixels; (0, 0) is a click."""
        self.command('POST', '/actions', {'actions': [{
            'type': 'pointer', 'id': 'mouse', 'parameters': {'pointerType': 'mouse'}, 'actions': [
                {'type': 'pointerMove', 'x': int(start[0]), 'y': int(start[1]), 'duration': 0},
                {'type': 'pointerDown', 'button': 0},
                *([{'type': 'pointerMove', 'x': int(start[0] + by[0]), 'y': int(start[1] + by[1]),
                    'duration': 100}] if by != (0, 0) else []),
                {'type': 'pointerUp', 'button': 0}]}]})
