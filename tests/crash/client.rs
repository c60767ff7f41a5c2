//! Requests to the service, which may go away in the middle of them.

use serde_json::Value;
use std::time::Duration;

/// A client of one service.
#[derive(Clone)]
pub struct Client {
    agent: ureq::Agent,
    base: String,
    /// The local token, for what only the data directory's owner may do.
    token: Option<String>,
}

/// An answer that arrived whole.
#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    pub body: Vec<u8>,
}

impl Answer {
    pub fn value(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or(Value::Null)
    }

    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }

    /// The stable code of a problem, or nothing.
    pub fn code(&self) -> String {
        self.value()["code"].as_str().unwrap_or_default().to_owned()
    }
}

impl Client {
    pub fn new(base: &str) -> Self {
        let agent = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .timeout_global(Some(Duration::from_secs(60)))
            .build()
            .new_agent();
        Self {
            agent,
            base: base.to_owned(),
            token: None,
        }
    }

    /// The client of the owner of the service's data directory.
    pub fn of_owner(base: &str, data: &std::path::Path) -> Self {
        let access = std::fs::read(data.join("local-access.json")).unwrap();
        let access: Value = serde_json::from_slice(&access).unwrap();
        Self {
            token: Some(access["token"].as_str().unwrap().to_owned()),
            ..Self::new(base)
        }
    }

    /// Sends a request; `None` where no whole answer came back.
    pub fn send(&self, method: &str, path: &str, media_type: &str, body: Vec<u8>) -> Option<Answer> {
        let request = ureq::http::Request::builder()
            .method(method)
            .uri(format!("{}{path}", self.base))
            .header("content-type", media_type)
            .header(
                "authorization",
                format!("Bearer {}", self.token.as_deref().unwrap_or("none")),
            )
            .body(body)
            .unwrap();
        let mut response = self.agent.run(request).ok()?;
        let status = response.status().as_u16();
        let body = response
            .body_mut()
            .with_config()
            .limit(64 << 20)
            .read_to_vec()
            .ok()?;
        Some(Answer { status, body })
    }

    pub fn json(&self, method: &str, path: &str, body: &Value) -> Option<Answer> {
        self.send(method, path, "application/json", body.to_string().into_bytes())
    }

    /// A GET that must succeed.
    pub fn get(&self, path: &str) -> Answer {
        let answer = self
            .send("GET", path, "application/json", Vec::new())
            .unwrap_or_else(|| panic!("GET {path}: no answer"));
        assert_eq!(answer.status, 200, "GET {path}: {}", answer.text());
        answer
    }

    /// Every entry of a list, page after page.
    pub fn list(&self, path: &str) -> Vec<Value> {
        let mut all = Vec::new();
        let mut cursor = String::new();
        loop {
            let page = self.get(&format!("{path}?limit=50{cursor}")).value();
            all.extend(page["items"].as_array().unwrap().iter().cloned());
            match page["next_cursor"].as_str() {
                Some(next) => cursor = format!("&cursor={next}"),
                None => return all,
            }
        }
    }
}
