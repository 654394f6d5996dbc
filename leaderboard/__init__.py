"""Monte Carlo campaigns, result store, ranking, tables, figures, the site and the `simnav` command."""
