"""A page's own script run without a browser: what it asks of the page is answered by stand-ins, sliders are moved."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

STANDIN = r"""
const elements = {};
function element(name) {
  const heard = {};
  const me = { name, value: "0", checked: false, textContent: "", hidden: false, className: "", style: {}, children: [],
    clientWidth: 400, clientHeight: 300, width: 400, height: 300,
    classList: { set: new Set(), add(c) { this.set.add(c); }, remove(c) { this.set.delete(c); },
                 toggle(c, on) { on ? this.set.add(c) : this.set.delete(c); } },
    addEventListener: (what, f) => (heard[what] = heard[what] || []).push(f),
    dispatch: (what) => (heard[what] || []).forEach((f) => f({})),
    appendChild(child) { this.children.push(child); return child; },
    remove() {},
    getContext: () => gl };
  me.parentElement = { querySelector: (what) => find(name + " " + what) };
  return me;
}
const find = (what) => (elements[what] = elements[what] || element(what));
const uniforms = [];
const gl = new Proxy({}, { get: (_, what) => (what === "uniformMatrix4fv" ? (_, __, M) => uniforms.push(M)
  : /^[A-Z_0-9]+$/.test(what) ? 1 : () => 0) });
const figure = Object.assign(element("figure"), { querySelector: find });
globalThis.document = { currentScript: { closest: () => figure }, createElement: element, activeElement: null };
globalThis.window = { addEventListener() {} };
globalThis.location = { hash: "" };
globalThis.devicePixelRatio = 1;
globalThis.matchMedia = () => ({ matches: false });
globalThis.ResizeObserver = class { observe() {} };
const frames = [];
globalThis.requestAnimationFrame = (f) => frames.push(f);
const settle = () => { while (frames.length) frames.shift()(); };
const heard = (name) => { find(`[name=${name}]`).dispatch("input"); settle(); };
const move = (name, value) => { find(`[name=${name}]`).value = value; heard(name); };
const tick = (name, on) => { find(`[name=${name}]`).checked = on; heard(name); };
const press = (name) => { find(`[name=${name}]`).dispatch("click"); settle(); };
const configured = () => JSON.parse(find(".configuration").textContent).joints;
const said = (k) => find(`[name=joint-${k}] output`).textContent;
const tell = [];
"""


def embedded(page: str) -> dict[str, Any]:
    """The data that a page carries."""
    found = re.findall(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)
    assert len(found) == 1
    data: dict[str, Any] = json.loads(found[0])
    return data


def drive(page: str, steps: str, folder: Path) -> list[Any]:
    """Run a page's program, then `steps` in JavaScript, which push on `tell` what is to come back."""
    program = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    assert len(program) == 1
    checked = re.findall(r'type="checkbox" name="([\w-]+)" checked', page)
    begin = [
        f"find(\"script[type='application/json']\").textContent = {json.dumps(json.dumps(embedded(page)))};",
        *(f"find('[name={name}]').checked = true;" for name in checked),
    ]
    file = folder / "driven.js"
    text = "\n".join([STANDIN, *begin, program[0], "settle();", steps, "console.log(JSON.stringify(tell));"])
    file.write_text(text, "utf-8")
    done = subprocess.run(["node", str(file)], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    out: list[Any] = json.loads(done.stdout)
    return out
