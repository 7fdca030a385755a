/* Preloaded into an MPI run: kills the process of rank KILL_RANK at its message number KILL_AT with the tag KILL_TAG, before
 * the message is sent, or after it if KILL_AFTER is set. */
#include <mpi.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int count;

static int is_due(int tag) {
    const char *of_tag = getenv("KILL_TAG"), *at = getenv("KILL_AT");
    const char *rank = getenv("KILL_RANK"), *own = getenv("OMPI_COMM_WORLD_RANK");
    if (!of_tag || !at || !rank || !own || strcmp(rank, own) != 0 || tag != atoi(of_tag)) return 0;
    return ++count == atoi(at);
}

static void end(void) {
    kill(getpid(), SIGKILL);
    pause();
}

int MPI_Isend(const void *bytes, int length, MPI_Datatype type, int to, int tag, MPI_Comm comm, MPI_Request *request) {
    int due = is_due(tag);
    if (due && !getenv("KILL_AFTER")) end();
    int outcome = PMPI_Isend(bytes, length, type, to, tag, comm, request);
    if (due) end();
    return outcome;
}
