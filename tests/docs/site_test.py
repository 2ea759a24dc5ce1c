"""The book as a site: its links lead somewhere, no page is wider than a small screen, and searches find their page.

usage: site_test.py SOURCE_TREE [--built]; 77: pip cannot fetch Sphinx, or there is no Chromium

`--built` checks build/site as it is. A headless Chromium opens every page in a frame of 390 pixels, and asks Pagefind as
a reader's browser does, for every line of searches.txt.
"""

import functools
import html.parser
import http.server
import json
import queue
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from urllib.parse import unquote, urljoin, urlsplit

WIDTH = 390  # pixels of a small telephone
FIRST = 3    # results among which the page must be
SECTIONS = 7
MOST_SECONDS = 60  # of the processor, for one build

PROGRAM = """<!doctype html><meta charset="utf-8"><body><script type="module">
const {pages, searches, ranking, width, first} = await (await fetch("/check.json")).json();
const wide = [], found = {};
const frame = document.createElement("iframe");
frame.style.width = width + "px";
frame.style.height = "800px";
document.body.append(frame);
for (const page of pages) {
  await new Promise((resolve) => { frame.onload = resolve; frame.src = page; });
  const seen = frame.contentDocument.documentElement.scrollWidth;
  if (seen > width) wide.push([page, seen]);
}
const pagefind = await import("/pagefind/pagefind.js");
await pagefind.options({ranking});
for (const words of searches) {
  const {results} = await pagefind.search(words);
  found[words] = (await Promise.all(results.slice(0, first).map((result) => result.data()))).map(({url}) => url);
}
await fetch("/result", {method: "POST", body: JSON.stringify({wide, found})});
</script>"""


class Page(html.parser.HTMLParser):
    """The links of a page, and the places in it that links can name."""

    def __init__(self, text):
        super().__init__()
        self.links, self.places, self.captions = [], {""}, 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        for name in ("href", "src"):
            if given.get(name):
                self.links.append(given[name])
        for name in ("id", "name"):
            if given.get(name):
                self.places.add(given[name])
        self.captions += "caption" in (given.get("class") or "").split() and tag == "p"


def dead_links(site):
    """Lines that name a page and a link of it that leads to no file, or to no place in one."""
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    dead, count = [], 0
    for path, page in pages.items():
        here = path.relative_to(site).as_posix()
        for link in page.links:
            parts = urlsplit(urljoin(f"site:///{here}", link) if not urlsplit(link).scheme else link)
            if urlsplit(link).scheme or link.startswith("//"):
                continue
            count += 1
            target = site / unquote(urlsplit(urljoin("/" + here, link)).path).lstrip("/")
            if target.is_dir():
                target /= "index.html"
            place = unquote(parts.fragment)
            if not target.exists() or (target in pages and place not in pages[target].places):
                dead.append(f"{here}: {link}")
    return dead, count, len(pages)


class Server(http.server.SimpleHTTPRequestHandler):
    """The site, the program that checks it, and a place where that leaves its result."""

    def __init__(self, task, results, *arguments, **options):
        self.task, self.results = task, results
        super().__init__(*arguments, **options)

    def do_GET(self):
        given = {"/check.html": ("text/html", PROGRAM), "/check.json": ("application/json", json.dumps(self.task))}
        if self.path not in given:
            return super().do_GET()
        kind, text = given[self.path]
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.end_headers()
        return self.wfile.write(text.encode())

    def do_POST(self):
        self.results.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_):
        pass


def seen_by_a_browser(browser, site, task):
    results = queue.Queue()
    serve = functools.partial(Server, task, results, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), serve) as server, tempfile.TemporaryDirectory() as profile:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        running = subprocess.Popen(
            [browser, "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}",
             f"http://127.0.0.1:{server.server_port}/check.html"], stderr=subprocess.DEVNULL)
        try:
            return results.get(timeout=600)
        finally:
            running.terminate()
            running.wait()
            server.shutdown()


def searches():
    """Pairs of what people type, and the pages of which one has to be among the first results."""
    for line in Path(__file__).with_name("searches.txt").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            words, pages = line.split("|")
            yield words.strip(), {f"/{page}.html" for page in pages.split()}


def ranking_of(page):
    """How a page orders what it finds."""
    return json.loads(re.search(r"const ranking = (\{.*?\});", page.read_text(encoding="utf-8"))[1])


def build(source):
    before = time.monotonic(), *resources()
    if subprocess.run([source / "scripts" / "site"]).returncode:
        sys.exit("scripts/site failed")
    used = sum(resources()) - sum(before[1:])
    print(f"built in {used:.0f} s of processor time, {time.monotonic() - before[0]:.0f} s")
    assert used <= MOST_SECONDS, f"expected at most {MOST_SECONDS} s"


def resources():
    import resource

    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime, used.ru_stime


def fetched(source):
    """Whether the tools of scripts/site are there, or pip can fetch them."""
    if (source / "build/site-tools/requirements.txt").exists():
        return True
    with tempfile.TemporaryDirectory() as folder:
        return not subprocess.run([sys.executable, "-m", "pip", "download", "--quiet", "--retries", "1", "--no-deps",
                                   "--dest", folder, "furo"]).returncode


def main(source, built):
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if not browser or not (built or fetched(source)):
        print("skipped: " + ("pip cannot fetch Sphinx" if browser else "there is no Chromium"))
        return 77
    if not built:
        build(source)
    site = source / "build" / "site"
    dead, links, pages = dead_links(site)
    print(f"{pages} pages, {links} links within the site, {len(dead)} of them dead")
    expected = dict(searches())
    task = {"pages": ["/" + path.relative_to(site).as_posix() for path in sorted(site.rglob("*.html"))
                      if "reference" not in path.parts and path.name not in ("index.html",) or path.parent.name == "docs"],
            "searches": list(expected), "ranking": ranking_of(site / "docs" / "index.html"), "width": WIDTH, "first": FIRST}
    seen = seen_by_a_browser(browser, site, task)
    print(f"{len(task['pages'])} pages shown, {len(seen['wide'])} wider than {WIDTH} pixels")
    lost = [f"{words}: {', '.join(seen['found'][words])}" for words, wanted in expected.items()
            if not wanted & set(seen["found"][words])]
    print(f"{len(expected)} searches, {len(lost)} without their page among the first {FIRST}")
    captions = Page((site / "docs" / "index.html").read_text(encoding="utf-8")).captions
    print(f"{captions} sections")
    problems = dead + [f"{page} is {width} pixels wide" for page, width in seen["wide"]] + lost
    print("\n".join(problems))
    return 1 if problems or captions != SECTIONS or len(expected) < 40 else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]).resolve(), "--built" in sys.argv))
