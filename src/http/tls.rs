//! HTTPS by the service itself, where it was built with the feature `tls`.

use super::config::ServiceConfig;
use std::path::PathBuf;

/// Why there is no HTTPS.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// This build cannot.
    #[error(
        "this shapelex was built without TLS; build it with `--features tls`, or put a proxy with TLS in front"
    )]
    NotBuilt,
    /// One file without the other.
    #[error("TLS needs both a certificate (--tls-cert) and its key (--tls-key)")]
    Incomplete,
    /// A file cannot be used.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

/// Whether the certificate and its key can be used, before anything listens or is opened.
///
/// # Errors
/// [`TlsError`].
pub fn check_tls(config: &ServiceConfig) -> Result<(), TlsError> {
    Tls::load(config).map(drop)
}

/// How connections are secured.
pub(super) enum Tls {
    /// Not at all.
    Off,
    /// With this certificate.
    #[cfg(feature = "tls")]
    On(tokio_rustls::TlsAcceptor),
}

impl Tls {
    /// Reads the certificate chain and the key, both PEM.
    ///
    /// # Errors
    /// [`TlsError`].
    pub fn load(config: &ServiceConfig) -> Result<Self, TlsError> {
        match (&config.tls_cert, &config.tls_key) {
            (None, None) => Ok(Self::Off),
            (Some(certificate), Some(key)) => Self::read(certificate.clone(), key.clone()),
            _ => Err(TlsError::Incomplete),
        }
    }

    #[cfg(not(feature = "tls"))]
    fn read(_: PathBuf, _: PathBuf) -> Result<Self, TlsError> {
        Err(TlsError::NotBuilt)
    }

    #[cfg(feature = "tls")]
    fn read(certificate: PathBuf, key: PathBuf) -> Result<Self, TlsError> {
        use rustls::ServerConfig;
        use rustls::crypto::ring;
        use rustls::pki_types::pem::PemObject;
        use rustls::pki_types::{CertificateDer, PrivateKeyDer};
        use std::sync::Arc;

        let fail = |path: &PathBuf, reason: String| TlsError::File {
            path: path.clone(),
            reason,
        };
        let chain = CertificateDer::pem_file_iter(&certificate)
            .and_then(Iterator::collect::<Result<Vec<_>, _>>)
            .map_err(|e| fail(&certificate, e.to_string()))?;
        if chain.is_empty() {
            return Err(fail(&certificate, "there is no certificate in it".to_owned()));
        }
        let private = PrivateKeyDer::from_pem_file(&key).map_err(|e| fail(&key, e.to_string()))?;
        let mut server = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
            .with_safe_default_protocol_versions()
            .map_err(|e| fail(&certificate, e.to_string()))?
            .with_no_client_auth()
            .with_single_cert(chain, private)
            .map_err(|e| fail(&key, e.to_string()))?;
        server.alpn_protocols = vec![b"http/1.1".to_vec()];
        Ok(Self::On(tokio_rustls::TlsAcceptor::from(Arc::new(server))))
    }
}
