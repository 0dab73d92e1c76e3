"""Where the cells of a request are computed: threads of this machine, a store on disk, a cluster."""
