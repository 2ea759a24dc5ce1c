// ricochet_certificates [--scene NAME] [--models DIR] [--iterations N]
#include "certificates.hpp"

#include <CLI/CLI.hpp>

int main(int count, char** arguments)
{
    using namespace ricochet;
    using namespace ricochet::bench;
    CLI::App app("Measure certificates", "ricochet_certificates");
    std::string only;
    std::string models;
    std::size_t iterations = 0;
    learn::CertifyOptions options;
    app.add_option("--scene", only, "cavern, arm2, arm3, arm4 or eigenvalue; default: all");
    app.add_option("--models", models, "directory where networks are kept");
    app.add_option("--iterations", iterations, "of the training");
    app.add_option("--limit", options.limit, "[s]");
    app.add_option("--levels", options.levels, "of each certificate");
    app.add_option("--closest", options.closest, "as in CertifyOptions");
    app.add_option("--threads", options.threads, "default 2");
    CLI11_PARSE(app, count, arguments);
    return certify_scenes(only, models, iterations, options) ? 0 : 1;
}
