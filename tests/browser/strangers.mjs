// What a page of another site can do to a service on loopback without keys, tried in a real browser: nothing.
import assert from "node:assert/strict";
import { spawn, execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, it } from "node:test";
import { chromium } from "playwright-core";

const binary = process.env.SHAPELEX_BIN;
const work = mkdtempSync(join(tmpdir(), "shapelex-browser-"));
const FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
  "--disable-component-update", "--disable-sync", "--host-resolver-rules=MAP evil.test 127.0.0.1",
  // Chromium has begun to keep pages of the network away from loopback; the service must not depend on it.
  "--disable-features=LocalNetworkAccessChecks,BlockInsecurePrivateNetworkRequests"];

/** A service in a directory of its own, on a free port. */
async function serve(name, args = []) {
  const data = join(work, name);
  const child = spawn(binary, ["serve", "--json", "--listen", "127.0.0.1:0", "--data", data, ...args],
    { stdio: ["ignore", "pipe", "pipe"] });
  let log = "";
  child.stderr.on("data", text => { log += text; });
  const line = await new Promise((resolve, reject) => {
    child.stdout.once("data", resolve);
    child.once("exit", code => reject(new Error(`the service ended with ${code}: ${log}`)));
  });
  const url = JSON.parse(line).listening;
  const stop = () => new Promise(resolve => { child.once("exit", resolve); child.kill("SIGTERM"); });
  return { url, port: new URL(url).port, data, stop, log: () => log };
}

/** What the service holds, asked without a browser. */
async function state(service) {
  const get = async path => (await (await fetch(service.url + path)).json()).items;
  const token = JSON.parse(readFileSync(join(service.data, "local-access.json"))).token;
  const keys = await fetch(`${service.url}/v1/keys`, { headers: { authorization: `Bearer ${token}` } });
  return {
    classes: (await get("/v1/classes")).map(c => `${c.name} ${c.shapes}`),
    jobs: (await get("/v1/jobs")).length,
    snapshots: (await get("/v1/snapshots")).map(s => s.id),
    keys: (await keys.json()).items.length,
  };
}

/** Everything a page can send to another origin, run inside the page. Returns what it could read of the answers. */
async function attack({ service, mesh, snapshot }) {
  const read = [];
  const send = async (path, options) => {
    try {
      const answer = await fetch(service + path, options);
      read.push(`${path} ${answer.type} ${answer.status} ${(await answer.text()).length}`);
    } catch (error) {
      read.push(`${path} failed`);
    }
  };
  const form = () => {
    const data = new FormData();
    data.append("file", new File([mesh], "evil.obj"));
    return data;
  };
  const types = ["text/plain", "application/x-www-form-urlencoded", ""];
  const simple = (type, body) => ({ method: "POST", mode: "no-cors", headers: type ? { "content-type": type } : {},
    body: type ? body : new Blob([body]) });
  for (const type of types) {
    await send("/v1/classes", simple(type, '{"name":"evil"}'));
    await send("/v1/keys", simple(type, '{"name":"evil","scope":"admin"}'));
    await send("/v1/reindex", simple(type, '{"scope":"all"}'));
    await send("/v1/classes/evil/shapes?create=true", simple(type, mesh));
    await send("/v1/snapshots/restore", simple(type, "evil"));
  }
  for (const path of ["/v1/reindex", "/v1/snapshots", `/v1/snapshots/${snapshot}/restore`]) {
    await send(path, { method: "POST", mode: "no-cors" });
    await send(path, { method: "POST", mode: "cors" });
  }
  for (const path of ["/v1/classes/evil/shapes?create=true", "/v1/query", "/v1/query/batch"]) {
    await send(path, { method: "POST", mode: "no-cors", body: form() });
    await send(path, { method: "POST", mode: "cors", body: form() });
  }
  await send("/v1/classes/dog", { method: "DELETE", mode: "cors" });
  await send("/v1/classes", { method: "POST", mode: "cors", headers: { "content-type": "application/json" },
    body: '{"name":"evil"}' });
  navigator.sendBeacon(`${service}/v1/classes`, '{"name":"evil"}');
  await send("/v1/classes", { mode: "cors" });
  return read;
}

/** Forms are sent by pages too, as navigations, with the body one field makes of it. */
async function submit({ service, path, enctype }) {
  const form = document.createElement("form");
  Object.assign(form, { method: "POST", action: service + path, enctype });
  const field = document.createElement("input");
  // As text/plain this is {"name":"evil","scope":"admin","x":"="}.
  Object.assign(field, { name: '{"name":"evil","scope":"admin","x":"', value: '"}' });
  form.append(field);
  document.body.append(form);
  form.submit();
}

let browser, service, named, other, otherPort, mesh, meshFile;

before(async () => {
  execFileSync(binary, ["zoo", "--out", join(work, "zoo"), "--classes", "2", "--poses", "2"], { stdio: "ignore" });
  other = createServer((_, answer) => answer.setHeader("content-type", "text/html").end("<title>other</title><body>"));
  await new Promise(resolve => other.listen(0, "127.0.0.1", resolve));
  otherPort = other.address().port;
  service = await serve("closed");
  named = await serve("named", ["--cors-origin", `http://127.0.0.1:${otherPort}`]);
  const small = ["atoms=12", "iterations=5", "batch=64", "samples_per_shape=100", "eigenpairs=50", "energies=40"];
  execFileSync(binary, ["index", join(work, "zoo"), "--server", service.url, ...small.flatMap(s => ["--set", s])],
    { stdio: "ignore" });
  const first = readdirSync(join(work, "zoo")).find(entry => !entry.includes("."));
  meshFile = join(work, "zoo", first, readdirSync(join(work, "zoo", first))[0]);
  mesh = readFileSync(meshFile, "utf8");
  browser = await chromium.launch({ executablePath: process.env.SHAPELEX_CHROMIUM, headless: true, args: FLAGS });
}, { timeout: 120_000 });

after(async () => {
  await browser?.close();
  await Promise.all([service, named].map(one => one?.stop()));
  other?.close();
  rmSync(work, { recursive: true, force: true });
});

describe("a service without keys on loopback", () => {
  for (const host of ["127.0.0.1", "localhost"]) {
    it(`is not changed by a page of http://${host} and another port`, { timeout: 120_000 }, async () => {
      const made = await fetch(`${service.url}/v1/snapshots`, { method: "POST" });
      const snapshot = (await made.json()).id;
      const before = await state(service);
      const page = await browser.newPage();
      await page.goto(`http://${host}:${otherPort}/`);
      const read = await page.evaluate(attack, { service: service.url, mesh, snapshot });
      assert.ok(read.length > 20);
      for (const line of read) assert.match(line, / opaque 0 0$| failed$/, line);
      for (const path of ["/v1/classes", "/v1/keys", "/v1/reindex", "/v1/snapshots/restore", "/v1/classes/evil/shapes?create=true"]) {
        for (const enctype of ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data"]) {
          const sender = await browser.newPage();
          await sender.goto(`http://${host}:${otherPort}/`);
          const answered = sender.waitForResponse(answer => answer.request().method() === "POST");
          await sender.evaluate(submit, { service: service.url, path, enctype });
          const answer = await answered;
          assert.equal(answer.status(), 403, `${path} ${enctype}`);
          await sender.close();
        }
      }
      await page.close();
      assert.deepEqual(await state(service), before);
    });
  }

  it("is not read by a page whose name was bound to this machine", async () => {
    const page = await browser.newPage();
    const evil = `http://evil.test:${service.port}`;
    assert.equal((await page.goto(`${evil}/`)).status(), 421);
    // The page came from the attacker's machine; since then its name is this machine's.
    await page.route(`${evil}/attack`, route => route.fulfill({ contentType: "text/html", body: "<title>evil</title>" }));
    await page.goto(`${evil}/attack`);
    const read = await page.evaluate(async () => {
      const found = [];
      for (const path of ["/v1/classes", "/v1/index", "/v1/snapshots", "/openapi.json"]) {
        found.push((await fetch(path)).status);
      }
      found.push((await fetch("/v1/reindex", { method: "POST" })).status);
      return found;
    });
    assert.deepEqual(read, [421, 421, 421, 421, 421]);
    await page.close();
  });

  it("is not embedded by a page of another site", async () => {
    const page = await browser.newPage();
    await page.goto(`http://localhost:${otherPort}/`);
    const loaded = await page.evaluate(url => new Promise(resolve => {
      const script = document.createElement("script");
      script.onload = () => resolve(true);
      script.onerror = () => resolve(false);
      script.src = `${url}/v1/classes`;
      document.body.append(script);
    }), service.url);
    assert.equal(loaded, false);
    await page.close();
  });

  for (const host of ["127.0.0.1", "localhost"]) {
    it(`answers its own page at http://${host}`, { timeout: 60_000 }, async () => {
      const page = await browser.newPage();
      const errors = [];
      page.on("pageerror", error => errors.push(String(error)));
      await page.goto(`http://${host}:${service.port}/`);
      await page.locator("#index", { hasText: "Generation" }).waitFor();
      await page.locator("input[type=file]").first().setInputFiles(meshFile);
      await page.locator("#ranking tr").first().waitFor();
      assert.deepEqual(errors, []);
      await page.close();
    });
  }

  it("lets the page of a named origin in, and no other", async () => {
    const ask = async host => {
      const page = await browser.newPage();
      await page.goto(`http://${host}:${otherPort}/`);
      const status = await page.evaluate(async url => {
        try {
          const made = await fetch(`${url}/v1/classes`, { method: "POST", headers: { "content-type": "application/json" },
            body: JSON.stringify({ name: `class of ${location.host}` }) });
          return made.status;
        } catch {
          return "failed";
        }
      }, named.url);
      await page.close();
      return status;
    };
    assert.equal(await ask("127.0.0.1"), 201);
    assert.equal(await ask("localhost"), "failed");
    assert.deepEqual((await state(named)).classes, [`class of 127.0.0.1:${otherPort} 0`]);
  });
});
