// kiln: the client.

#include "server/cli/commands/commands.h"

int main(int argc, char** argv) {
  return lightkiln::cli::run(argc, argv);
}
