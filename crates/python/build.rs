//! Linker arguments for macOS, where Python provides the module's symbols at load time.
fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
