//! Whom a client believes that a https:// service is who it says.

use super::CliError;
use std::path::Path;
use std::sync::Arc;
use ureq::tls::{Certificate, PemItem, RootCerts, TlsConfig, parse_pem};

/// Trust in the certificates of a PEM file, or in the well-known authorities where there is none.
///
/// # Errors
/// [`CliError::Usage`] where the file cannot be read or has no certificate.
pub fn config(ca_cert: Option<&Path>) -> Result<TlsConfig, CliError> {
    let roots = match ca_cert {
        None => RootCerts::WebPki,
        Some(path) => {
            let wrong = |reason: String| CliError::Usage(format!("--ca-cert {}: {reason}", path.display()));
            let pem = std::fs::read(path).map_err(|error| wrong(error.to_string()))?;
            let certificates = certificates(&pem).map_err(wrong)?;
            RootCerts::Specific(Arc::new(certificates))
        }
    };
    Ok(TlsConfig::builder().root_certs(roots).build())
}

/// No check of the certificate, for a service on this machine. The certificate names the service's public host, not its
/// loopback address, and may be self-signed. The address comes from a file in the data directory that only its owner can
/// write, and the packets do not leave the machine.
pub fn this_machine() -> TlsConfig {
    TlsConfig::builder().disable_verification(true).build()
}

fn certificates(pem: &[u8]) -> Result<Vec<Certificate<'static>>, String> {
    let mut found = Vec::new();
    for item in parse_pem(pem) {
        if let PemItem::Certificate(certificate) = item.map_err(|error| error.to_string())? {
            found.push(certificate);
        }
    }
    if found.is_empty() {
        return Err("there is no certificate in it; expected PEM, -----BEGIN CERTIFICATE-----".to_owned());
    }
    Ok(found)
}
